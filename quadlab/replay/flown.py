"""The estimators on which a recorded flight was flown, and since when they ran."""

from __future__ import annotations

from itertools import groupby
from typing import NamedTuple

from quadlab.replay.log import Recording

ESTIMATOR, SOURCE = "estimation.estimator", "estimation.source"
SHADOWS = SHADOW, SHADOW_SOURCE = "estimation.shadow", "estimation.shadow_source"
CHOICES = (ESTIMATOR, SOURCE, *SHADOWS)

EstimatorAndSource = tuple[str, str]  # estimator, source


class Choice(NamedTuple):
    """An estimator with its source, and how long it was flown on while airborne."""

    estimator: str
    source: str
    seconds: float
    begin_ns: int | None  # stamp after which it ran, as a shadow at first; None: from the start


def flown_choices(recording: Recording) -> list[Choice]:
    """Return the choices with which the flight was flown, the longest first."""
    p = recording.parameters.estimation
    chosen = {
        ESTIMATOR: p.estimator,
        SOURCE: p.source,
        SHADOW: p.shadow,
        SHADOW_SOURCE: p.shadow_source,
    }
    flying = [stamp_ns for stamp_ns, airborne in recording.airborne if airborne]
    begin_ns = flying[0] if flying else recording.start_ns
    end_ns = flying[-1] if flying else int(recording.imu["stamp_ns"][-1])

    running: dict[EstimatorAndSource, int | None] = dict.fromkeys(_pairs(chosen))
    spans: dict[EstimatorAndSource, int] = {}
    begins: dict[EstimatorAndSource, int | None] = {}

    def fly_until(stamp_ns: int) -> None:
        nonlocal begin_ns
        until_ns = min(max(stamp_ns, begin_ns), end_ns)
        flown = _pairs(chosen)[0]
        spans[flown] = spans.get(flown, 0) + until_ns - begin_ns
        begins.setdefault(flown, running[flown])
        begin_ns = until_ns

    changes = (change for change in recording.changes if change.name in CHOICES)
    for (stamp_ns, _), group in groupby(changes, key=lambda one: one[:2]):
        fly_until(stamp_ns)
        chosen |= {change.name: str(change.value) for change in group}
        running = {pair: running.get(pair, stamp_ns) for pair in _pairs(chosen)}
    fly_until(end_ns)
    longest = sorted(spans.items(), key=lambda item: -item[1])
    found = [Choice(*pair, 1e-9 * span, begins[pair]) for pair, span in longest]
    return [one for one in found if one.seconds > 0.0] or found[:1]


def _pairs(chosen: dict[str, str]) -> list[EstimatorAndSource]:
    """Return the running estimators: the one flown on, then its shadow if there is one."""
    flown = (chosen[ESTIMATOR], chosen[SOURCE])
    if chosen[SHADOW] == "none":
        return [flown]
    source = chosen[SHADOW_SOURCE]
    return [flown, (chosen[SHADOW], chosen[SOURCE] if source == "same" else source)]
