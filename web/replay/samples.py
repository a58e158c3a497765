"""Samples of a run's signals: columns of the log, those computed from several, expressions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from flight_log.run import Series
from quadrotor.errors import OutOfBoundsError
from web.replay.signals import derived, members_of
from web.signals.expression import answers, is_expression, parse

BIN = 16
"""Number of samples whose minimum and maximum are cached, to draw a whole flight."""
MOST_BINNED = 64
"""Number of columns whose extremes are cached: 300 kB each for 20 min at 500 Hz."""
MOST_EVALUATED = 16
"""Number of expressions whose samples are cached: 5 MB each for 20 min at 500 Hz."""
PIECE = 1 << 16
"""Number of samples that are computed at once."""

Array = npt.NDArray[np.float64]
Extremes = tuple[Array, Array]
Made = dict[tuple[str, int, int], Sequence[Array]]
"""Signals that one answer has computed, by the first one of their source and the samples' range."""
Row = dict[str, Any]
"""Signal as web.replay.signals describes it."""


class Samples:
    """Samples of all signals of a run; thread-safe.

    Args:
        topics: the run's topics.
        signals: the signals that its replay was built with.
    """

    def __init__(self, topics: Mapping[str, Series], signals: Iterable[Row]) -> None:
        self._topics = topics
        made = derived(topics, members_of(topics)).values()
        self._made = {column: one for its in made for column, one in its.items()}
        self._signals = {row["name"]: row for row in signals}
        self._units = {name: row["unit"] for name, row in self._signals.items()}
        self._evaluated = lru_cache(MOST_EVALUATED)(self._evaluate)
        self._extremes = lru_cache(MOST_BINNED)(self._binned)

    def known(self, name: str) -> Row | None:
        """Return a signal of the log; None if the log does not have it."""
        return self._signals.get(name)

    def row(self, name: str) -> Row:
        """Return a signal of the log or one derived by an expression, whose text its name is.

        Raises OutOfBoundsError for an unknown signal or a wrong expression.
        """
        if (row := self.known(name)) is not None:
            return row
        if is_expression(name):
            return self._derived(name)
        raise OutOfBoundsError(f"no signal {name!r:.80} in this run; its page lists them")

    def expressions(self, texts: Sequence[str]) -> list[dict[str, Any]]:
        """Return the derived signal of each text, or what is wrong with it as `problem`."""
        return answers(texts, self._derived)

    def times(self, row: Row) -> Array:
        return self._topics[row["topic"]].time

    def values(self, row: Row, first: int, last: int, made: Made | None = None) -> Array:
        """Return the samples of a signal with `first` <= index < `last`."""
        column = row["column"]
        if column in self._made:
            place = self._made[column][2]
            return self._make(column, first, last, {} if made is None else made)[place]
        samples: Array = self._column(row["topic"], column, first, last) * row["factor"]
        return samples

    def extremes(self, row: Row, first: int, last: int) -> Extremes:
        """Return minimum and maximum of each of the bins `first` <= index < `last` of a signal."""
        column, factor = row["column"], row["factor"]
        source, _, place = self._made.get(column, (None, [], 0))
        key = f"@{source.signals[0].name}" if source else column
        low, high = (factor * bins[first:last] for bins in self._extremes(row["topic"], key)[place])
        return (low, high) if factor >= 0.0 else (high, low)

    def _derived(self, text: str) -> Row:
        expression = parse(text, self._units)
        described = expression.described(self._signals[expression.inputs[0]]["topic"])
        return described | {"column": expression.name, "factor": 1.0}

    def _evaluate(self, text: str) -> Array:
        """Return all samples of an expression, at the times of the first signal in it."""
        expression = parse(text, self._units)
        step, times = expression.start(), self.times(self._derived(text))
        pieces = [np.zeros(0)]
        for first in range(0, len(times), PIECE):
            last, made = min(first + PIECE, len(times)), Made()
            columns = {
                name: self._at(name, times, first, last, made).astype(float, copy=False)
                for name in expression.inputs
            }
            pieces.append(step(times[first:last], columns))
        return np.concatenate(pieces)

    def _column(self, topic: str, column: str, first: int, last: int) -> npt.NDArray[Any]:
        if is_expression(column):
            return self._evaluated(column)[first:last]
        return self._topics[topic].values(column, first, last)

    def _make(self, column: str, first: int, last: int, made: Made) -> Sequence[Array]:
        """Return all signals of the source of a derived column."""
        source, names, _ = self._made[column]
        assert source.function is not None
        key = (source.signals[0].name, first, last)
        if key not in made:
            series = self._topics[source.topic]
            columns = [series.values(name, first, last) for name in names]
            inputs = [self._at(name, series.time, first, last, made) for name in source.inputs]
            with np.errstate(invalid="ignore", divide="ignore"):
                made[key] = source.function(np, *columns, *inputs)
        return made[key]

    def _at(self, name: str, times: Array, first: int, last: int, made: Made) -> Array:
        """Return a signal at times[first:last], interpolated; NaN outside of its samples."""
        row, wanted = self.row(name), times[first:last]
        its = self.times(row)
        if its is times or not len(wanted):
            return self.values(row, first, last, made)
        begin = max(count_before(its, wanted[0]) - 1, 0)
        end = min(count_before(its, wanted[-1]) + 1, len(its))
        samples = self.values(row, begin, end, made)
        between: Array = np.interp(wanted, its[begin:end], samples, left=np.nan, right=np.nan)
        return between

    def _binned(self, topic: str, column: str) -> list[Extremes]:
        """Return minimum and maximum of every BIN samples.

        They are of a column, or of all signals of the source of a derived one.
        """
        count = len(self._topics[topic])
        pieces: list[list[Extremes]] = []
        for first in range(0, count, PIECE):
            last = min(first + PIECE, count)
            if column in self._made:
                values = self._make(column, first, last, {})
            else:
                values = [self._column(topic, column, first, last).astype(float, copy=False)]
            pieces.append([coarser(one, one, BIN) for one in values])
        return [
            (np.concatenate([low for low, _ in its]), np.concatenate([high for _, high in its]))
            for its in zip(*pieces, strict=True)
        ]


def coarser(low: Array, high: Array, factor: int) -> tuple[Array, Array]:
    """Return bins of `factor` values, the last of the remainder; NaN only if all are NaN."""
    if factor <= 1 or len(low) == 0:
        return low, high
    begins = np.arange(0, len(low), factor)
    return np.fmin.reduceat(low, begins), np.fmax.reduceat(high, begins)


def count_before(times: Array, t: float) -> int:
    """Return the number of times at or before t."""
    return int(np.searchsorted(times, t, side="right"))
