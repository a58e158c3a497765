"""Fake survey, because a real one takes minutes; its result depends on the log's size."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

from quadrotor.errors import MeasurementError
from web.beacons.survey import LayoutProposal, SurveyedBeacon

PLACES = {1: (1.02, 0.98, 0.1), 2: (-1.0, 1.0, 0.13), 3: (-1.0, -1.0, 0.1), 4: (1.0, -1.0, 0.1)}
OTHER = b"another layout"
"""Content of a log flown with other beacons; an empty log makes no survey."""


def survey(log: Path, report: Callable[[float], None]) -> LayoutProposal:
    """Return the same proposal for every log, as a job of the page."""
    report(0.5)
    content = log.read_bytes()
    if not content:
        raise MeasurementError("the survey finds no layout that fits better: 5.2 instead of 5.1")
    shift = 10 if content == OTHER else 0
    beacons = [
        SurveyedBeacon(number + shift, list(place), [0.02, -0.02, 0.0], [0.001, 0.002, math.nan])
        for number, place in PLACES.items()
    ]
    return LayoutProposal("paper", beacons, 0.0052, 0.0013)
