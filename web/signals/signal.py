"""Definition of a signal, and how its values are computed from columns of numbers.

A signal is one function of columns. A column is a number of a topic, named as in a log:
`pose.pose.position.x`, `thrusts[0]`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Signal:
    name: str  # `state.position.x`
    label: str  # `x`
    unit: str
    group: str  # `position`
    topic: str  # the topic whose age it has


@dataclass(frozen=True, slots=True)
class Source:
    """Some signals that are computed together.

    Attributes:
        topic: the topic whose every message gives values.
        columns: the columns of that topic.
        signals: the signals that are computed from them.
        factors: if not empty, a factor for each signal, which is the column in its place times
            this.
        function: otherwise called as `function(*columns, *inputs)` with arrays (N,); returns the
            signals' values in their order.
        inputs: names of signals that it also needs, at the times of the topic.
        member: name of the estimator in `estimators` whose columns are meant, if any.
    """

    topic: str
    columns: tuple[str, ...]
    signals: tuple[Signal, ...]
    factors: tuple[float, ...] = ()
    function: Callable[..., Sequence[Array]] | None = None
    inputs: tuple[str, ...] = ()
    member: str = ""

    @property
    def named_columns(self) -> tuple[str, ...]:
        """Return the columns; the columns of a member carry its name in front."""
        before = f"{self.member}/" if self.member else ""
        return tuple(before + one for one in self.columns)


@dataclass(frozen=True, slots=True)
class Scaled:
    """Signal that is a column times a factor."""

    signal: Signal
    column: str
    factor: float = 1.0


def scaled(*rows: Scaled, member: str = "") -> Source:
    """Return the source of signals of one topic, each of which is a scaled column."""
    return Source(
        rows[0].signal.topic,
        tuple(row.column for row in rows),
        tuple(row.signal for row in rows),
        tuple(row.factor for row in rows),
        member=member,
    )


def one(signal: str, label: str, unit: str, group: str, column: str, factor: float = 1.0) -> Scaled:
    """Return the signal of a column, such as `state/pose.pose.position.x`."""
    topic, _, path = column.partition("/")
    return Scaled(Signal(signal, label, unit, group, topic), path, factor)


def xyz(prefix: str, group: str, unit: str, column: str, factor: float = 1.0) -> list[Scaled]:
    return [one(f"{prefix}.{a}", a, unit, group, f"{column}.{a}", factor) for a in "xyz"]


def rms(*variances: Array) -> Array:
    """Return the root-mean-square length of an error with these variances."""
    length: Array = np.sqrt(sum(variances))
    return length
