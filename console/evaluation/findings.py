"""Findings of a run: claims about what happened, each with its evidence.

Extensions find them (`quadrotor.extension.Explanation`); page, reports and command line show them.
Times are s since the run's first message.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from flight_log.attached import parameters_of
from flight_log.run import Series, read_run
from quadrotor.extension import Explanation
from quadrotor.extensions import registry
from quadrotor.parameter_description import ParameterValue

Array = npt.NDArray[np.floating]
Topics = Mapping[str, Series]
Parameters = Mapping[str, ParameterValue]
Spans = list[tuple[float, float]]

AT_BOUND = "at_bound"
"""Flag of a bias, an integral or an estimate that its bound has held for a second."""
HELD, NEARLY = 1.0, 1.0 - 1e-5
"""Limit in s for which a bound may hold an estimate; share of the bound that counts as reached."""


@dataclass(frozen=True)
class Finding:
    """One claim about a flight; times are s since the run's first message.

    Attributes:
        weight: the figure relative to its limit.
        follows: whether it can be the consequence of another finding.
        confidence: share of the evidence for any cause, 0 to 1; 0 for a consequence.
        alike: causes that leave the same evidence in this flight, which nothing here tells apart.
        signals: names of the page's signals that show it.
        label, unit, limit, time, values: the evidence, to be plotted.
    """

    kind: str
    weight: float
    start: float
    end: float
    claim: str
    signals: tuple[str, ...]
    label: str
    unit: str
    limit: float
    time: Array
    values: Array
    follows: bool = False
    confidence: float = 0.0
    alike: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """Return the claim, with the causes that this flight does not tell apart."""
        if not self.alike:
            return self.claim
        *others, last = self.alike
        return f"{self.claim} It may be {', '.join(others)} or {last}: this flight does not tell."

    def as_json(self) -> dict[str, Any]:
        """Return the finding for the page, without the columns of the evidence."""
        return {
            "kind": self.kind,
            "weight": round(self.weight, 2),
            "confidence": round(self.confidence, 2),
            "from": round(self.start, 3),
            "to": round(self.end, 3),
            "text": self.text,
            "alike": list(self.alike),
            "signals": list(self.signals),
        }


Explain = Callable[[Topics, Parameters], list[Finding]]


def explain(topics: Topics, parameters: Parameters) -> list[Finding]:
    """Return the findings of a run by all installed explanations, heaviest first, consequences
    after causes.
    """
    found: list[Finding] = []
    for one in registry().offers(Explanation).values():
        found += one.load()(topics, parameters)
    return sorted(found, key=lambda one: (one.follows, -one.weight))


def explain_log(path: Path) -> list[Finding]:
    """Read a log and explain it. Raises StorageError or LogFormatError."""
    run = read_run(path)
    return explain(run.topics, parameters_of(run.log.attachments.get("parameters.json")))


def within(time: Array, spans: Spans) -> npt.NDArray[np.bool_]:
    found = np.zeros(len(time), bool)
    for start, end in spans:
        found |= (time >= start) & (time <= end)
    return found


def flagged(topics: Topics, flag: str, field: str = "flags") -> Spans:
    """Return when a flag of the vehicle's status was set, or another text of it was this one."""
    if "status" not in topics:
        return []
    changes = topics["status"].changes(field)
    ends = [time for time, _ in changes[1:]] + [float(topics["status"].time[-1])]
    found: Spans = []
    for (start, text), end in zip(changes, ends, strict=False):
        if flag not in text.split(", "):
            continue
        begin = found.pop()[0] if found and found[-1][1] == start else start
        found.append((begin, end))
    return found


def stretches(time: Array, on: npt.NDArray[np.bool_]) -> Spans:
    """Return the intervals (s) in which successive samples are on."""
    edges = np.diff(np.concatenate([[0], on.astype(int), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return [(float(time[a]), float(time[b])) for a, b in zip(starts, ends, strict=True)]
