"""The outcome of a trial, from the rows of its flights alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from extensions.campaigns.search.plan import Search

AGGREGATES: dict[str, Callable[[npt.NDArray[np.float64]], Any]] = {
    "worst": np.max,
    "median": np.median,
    "mean": np.mean,
}
PENALTY = 1e6
"""The value of an aim in a trial that is not feasible, times one more than what it lacks."""


@dataclass(frozen=True, slots=True)
class Row:
    """The part of a flight's row that a search reads: NaN where it has no such metric."""

    is_passed: bool
    values: tuple[float, ...]


@dataclass(frozen=True)
class Judged:
    """A trial after some of its flights.

    Attributes:
        values: of the aims; empty without a flight that has them.
        lacks: how far each constraint is violated, at most 0 where it is met.
        reason: why it is not feasible, empty if it is.
    """

    values: tuple[float, ...]
    lacks: Mapping[str, float] = field(default_factory=dict)
    reason: str = ""

    def values_told(self, aims: int) -> list[float]:
        """Return a number for each aim, for a sampler that knows no constraints."""
        if not self.reason:
            return [*self.values]
        return [PENALTY * (1.0 + sum(max(0.0, one) for one in self.lacks.values()))] * aims


def judge(search: Search, rows: Sequence[Row]) -> Judged:
    """Judge a trial by the flights that it has so far."""
    aims = len(search.aims)
    table: npt.NDArray[np.float64] = np.array([one.values for one in rows], float)
    table = table.reshape(len(rows), len(search.metrics))
    missed = sum(not one.is_passed for one in rows)
    lacks = {"not_passed": float(missed - search.not_passed)}
    reason = f"{missed} of {len(rows)} flights did not pass" if missed > search.not_passed else ""
    for k, (name, limit) in enumerate(search.constraints.items(), aims):
        finite = table[np.isfinite(table[:, k]), k]
        lacks[name] = float(finite.max() - limit) if len(finite) else 1.0
        if lacks[name] > 0.0 and not reason:
            most = f"{finite.max():.5g}" if len(finite) else "in no flight"
            reason = f"{name} is {most}, at most {limit:g} is feasible"
    aggregate = AGGREGATES[search.aggregate]
    columns = [table[np.isfinite(table[:, k]), k] for k in range(aims)]
    if not all(len(one) for one in columns):
        return Judged((), lacks, reason or "no flight has the metrics of the aims")
    return Judged(tuple(float(aggregate(one)) for one in columns), lacks, reason)


def front(values: Sequence[Sequence[float]]) -> list[int]:
    """Return the places of the values that no others are better than in each aim, or equal to."""
    points = np.array(values, float)
    kept = []
    for k, point in enumerate(points):
        others = (points <= point).all(axis=1) & (points < point).any(axis=1)
        if not others.any():
            kept.append(k)
    return kept
