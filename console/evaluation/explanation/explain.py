"""All detectors over one run, and the order of what they find."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from console.evaluation.explanation import bearings, causes, consequences, instruments
from console.evaluation.explanation.finding import Finding, Parameters, Spans, Topics, airborne
from flight_log.attached import parameters_of
from flight_log.run import read_run

DETECTORS: tuple[Callable[[Topics, Parameters, Spans], Iterator[Finding]], ...] = (
    instruments.instruments,
    causes.weak_motor,
    causes.vibration,
    causes.tracker_late,
    causes.tracker_gaps,
    causes.tracker_outliers,
    bearings.beacon_off,
    bearings.bearings_disagree,
    bearings.fell_back,
    causes.link_lost,
    causes.battery_sag,
    consequences.off_reference,
    consequences.saturation,
    consequences.inconsistent,
    consequences.tilted,
    consequences.at_bound,
)


def explain(topics: Topics, parameters: Parameters) -> list[Finding]:
    """Return the events of a run, heaviest first, consequences after causes.

    A detector ignores a run without the topics that it needs.
    """
    topics = {name: one for name, one in topics.items() if len(one)}
    spans = airborne(topics)
    found = [one for detector in DETECTORS for one in detector(topics, parameters, spans)]
    return sorted(found, key=lambda one: (one.follows, -one.weight))


def explain_log(path: Path) -> list[Finding]:
    """Read a log and explain it. Raises StorageError or LogFormatError."""
    run = read_run(path)
    return explain(run.topics, parameters_of(run.log.attachments.get("parameters.json")))
