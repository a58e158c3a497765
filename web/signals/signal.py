"""Definition of a signal, and how its values are computed from columns of numbers.

A signal is one function of columns: of N numbers each in a log, of one each live. A column is a
number of a topic, named as in a log: `pose.pose.position.x`, `thrusts[0]`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any

from vehicle_link.messages.units import Path, number_at


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
        topic: the topic whose newest message, or whose every message, gives values.
        columns: the columns of that topic.
        signals: the signals that are computed from them.
        factors: if not empty, a factor for each signal, which is the column in its place times
            this.
        function: otherwise called as `function(xp, *columns, *inputs)` with xp = math and floats,
            or with xp = numpy and arrays (N,); returns the signals' values in their order.
        inputs: names of signals that it also needs; in a log, interpolated between their samples.
        member: name of the estimator in `estimators` whose columns are meant, if any.
    """

    topic: str
    columns: tuple[str, ...]
    signals: tuple[Signal, ...]
    factors: tuple[float, ...] = ()
    function: Callable[..., Sequence[Any]] | None = None
    inputs: tuple[str, ...] = ()
    member: str = ""
    _read: Callable[[Any], Sequence[float]] = field(init=False, repr=False, compare=False)
    _is_scaled: bool = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_read", _reader(self.columns))
        object.__setattr__(self, "_is_scaled", any(factor != 1.0 for factor in self.factors))

    def values(self, message: Any, inputs: Sequence[float]) -> Sequence[float] | None:
        """Return the values of a message; None if it lacks the member."""
        if self.member:
            message = next((r for r in message.estimators if r.name == self.member), None)
            if message is None:
                return None
        columns = self._read(message)
        if self.function is not None:
            values: Sequence[float] = self.function(math, *columns, *inputs)
            return values
        if not self._is_scaled:
            return columns
        return [value * factor for value, factor in zip(columns, self.factors, strict=True)]


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


def rms(xp: Any, *variances: Any) -> Any:
    """Return the root-mean-square length of an error with these variances."""
    total = sum(variances)
    return math.nan if xp is math and not total >= 0.0 else xp.sqrt(total)


def path_of(column: str) -> Path:
    """Return the steps of a column: `thrusts[0]` has two."""
    return tuple(
        int(step) if step.isdigit() else step for step in re.split(r"[.\[\]]+", column) if step
    )


def _reader(columns: Sequence[str]) -> Callable[[Any], Sequence[float]]:
    if len(columns) > 1 and not any("[" in column for column in columns):
        return attrgetter(*columns)
    paths = [path_of(column) for column in columns]
    return lambda message: [number_at(message, path) for path in paths]
