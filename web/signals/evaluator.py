"""Values of signals from columns of topics, by the same rules on the live page and in a replay.

A sample of a signal belongs to one message of its own topic, and has its time. An input of another
topic is interpolated linearly between its two samples around that time; it has no value outside of
its samples, and none in a hole longer than the deadline of its topic (`web.latest.STALE`). Topics
of the same ticks share their times, so that their samples are of one tick and are not interpolated.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from web.latest import STALE
from web.signals.expression import Expression
from web.signals.functions import Step
from web.signals.signal import Array, Source

Made = dict[tuple[str, int, int], Sequence[Array]]
"""Signals that one answer has computed, by the first one of their source and the samples' range."""


class Columns(Protocol):
    """N messages of a topic in the order of their time; `time` in s, (N,)."""

    @property
    def time(self) -> Array: ...

    def values(self, name: str, first: int, last: int) -> npt.NDArray[Any]:
        """Return a column of the messages `first` to `last` - 1."""
        ...


class Place(NamedTuple):
    """The origin of a signal: its number in a source, and the source's columns in this log."""

    topic: str
    source: Source
    number: int
    columns: Sequence[str]


class Evaluator(ABC):
    """Evaluator of the signals of these topics."""

    def __init__(self, topics: Mapping[str, Columns]) -> None:
        self._topics = topics

    @abstractmethod
    def place(self, name: str) -> Place | Expression:
        """Return where a signal comes from. Raises OutOfBoundsError for an unknown one."""

    @abstractmethod
    def expression_values(self, expression: Expression, first: int, last: int) -> Array:
        """Return samples of a derived signal."""

    def topic(self, name: str) -> str:
        """Return the topic whose times a signal has: that of a derived one is its first input's."""
        place = self.place(name)
        return self.topic(place.inputs[0]) if isinstance(place, Expression) else place.topic

    def times(self, name: str) -> Array:
        """Return the times of a signal's samples, none where the log lacks its topic."""
        topic = self._topics.get(self.topic(name))
        return np.zeros(0) if topic is None else topic.time

    def values(self, name: str, first: int, last: int, made: Made | None = None) -> Array:
        """Return the samples of a signal with `first` <= index < `last`."""
        place = self.place(name)
        if isinstance(place, Expression):
            return self.expression_values(place, first, last)
        source, column = place.source, place.columns[place.number : place.number + 1]
        if source.function is None:
            samples: Array = self._topics[place.topic].values(column[0], first, last)
            return samples * source.factors[place.number]
        return self._make(place, first, last, {} if made is None else made)[place.number]

    def at(self, name: str, times: Array, first: int, last: int, made: Made) -> Array:
        """Return a signal at times[first:last]."""
        wanted, its = times[first:last], self.times(name)
        if not len(its):
            return np.full(len(wanted), np.nan)
        if its is times or not len(wanted):
            return self.values(name, first, last, made)
        begin = max(count_before(its, wanted[0]) - 1, 0)
        end = min(count_before(its, wanted[-1]) + 1, len(its))
        samples = self.values(name, begin, end, made)
        return between(wanted, its[begin:end], samples, STALE.get(self.topic(name), math.inf))

    def step(self, expression: Expression, step: Step, first: int, last: int) -> Array:
        """Return the next samples of a derived signal, whose `step` has computed those before."""
        times, made = self.times(expression.name), Made()
        columns = {
            name: self.at(name, times, first, last, made).astype(float, copy=False)
            for name in expression.inputs
        }
        return step(times[first:last], columns)

    def _make(self, place: Place, first: int, last: int, made: Made) -> Sequence[Array]:
        """Return all signals of a source."""
        source, topic = place.source, self._topics[place.topic]
        assert source.function is not None
        key = (source.signals[0].name, first, last)
        if key not in made:
            columns = [topic.values(name, first, last) for name in place.columns]
            inputs = [self.at(name, topic.time, first, last, made) for name in source.inputs]
            with np.errstate(invalid="ignore", divide="ignore"):
                made[key] = source.function(*columns, *inputs)
        return made[key]


def between(wanted: Array, times: Array, samples: Array, longest: float) -> Array:
    """Return samples at the wanted times, interpolated across at most `longest` (s), else NaN."""
    found: Array = np.interp(wanted, times, samples, left=np.nan, right=np.nan)
    after = np.minimum(np.searchsorted(times, wanted), len(times) - 1)
    hole = times[after] - times[np.maximum(after - 1, 0)]
    found[(hole > longest) & (times[after] != wanted)] = np.nan
    return found


def count_before(times: Array, t: float) -> int:
    """Return the number of times at or before t."""
    return int(np.searchsorted(times, t, side="right"))
