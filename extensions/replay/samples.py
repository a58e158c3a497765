"""Samples of a run's signals: columns of the log, those computed from several, expressions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from extensions.replay.signals import derived, members_of
from flight_log.run import Series
from quadrotor.errors import OutOfBoundsError
from web.signals.evaluator import Evaluator, Place
from web.signals.expression import Expression, answers, is_expression, parse
from web.signals.signal import Array, Scaled, Signal, scaled

BIN = 16
"""Number of samples whose minimum and maximum are cached, to draw a whole flight."""
MOST_BINNED = 64
"""Number of columns whose extremes are cached: 300 kB each for 20 min at 500 Hz."""
MOST_EVALUATED = 16
"""Number of expressions whose samples are cached: 5 MB each for 20 min at 500 Hz."""
PIECE = 1 << 16
"""Number of samples that are computed at once."""

Extremes = tuple[Array, Array]
Row = dict[str, Any]
"""Signal as extensions.replay.signals describes it."""


class Samples(Evaluator):
    """Samples of all signals of a run; thread-safe.

    Args:
        topics: the run's topics.
        signals: the signals that its replay was built with.
    """

    def __init__(self, topics: Mapping[str, Series], signals: Iterable[Row]) -> None:
        super().__init__(topics)
        made = derived(topics, members_of(topics)).values()
        self._made = {column: one for its in made for column, one in its.items()}
        self._signals = {row["name"]: row for row in signals}
        self._units = {name: row["unit"] for name, row in self._signals.items()}
        self._places = {name: self._place(row) for name, row in self._signals.items()}
        self._parsed = lru_cache(MOST_EVALUATED)(lambda text: parse(text, self._units))
        self._evaluated = lru_cache(MOST_EVALUATED)(self._evaluate)
        self._extremes = lru_cache(MOST_BINNED)(self._binned)

    def has(self, name: str) -> bool:
        """Return whether the log has this signal."""
        return name in self._signals

    def place(self, name: str) -> Place | Expression:
        """Return where a signal of the log comes from, or one whose text its name is.

        Raises OutOfBoundsError for an unknown signal or a wrong expression.
        """
        if (place := self._places.get(name)) is not None:
            return place
        if is_expression(name):
            return self._parsed(name)
        raise OutOfBoundsError(f"no signal {name!r:.80} in this run; its page lists them")

    def expressions(self, texts: Sequence[str]) -> list[dict[str, Any]]:
        """Return the derived signal of each text, or what is wrong with it as `problem`."""

        def described(text: str) -> Row:
            expression = parse(text, self._units)
            return expression.described(self.topic(expression.inputs[0]))

        return answers(texts, described)

    def expression_values(self, expression: Expression, first: int, last: int) -> Array:
        return self._evaluated(expression.name)[first:last]

    def extremes(self, name: str, first: int, last: int) -> Extremes:
        """Return minimum and maximum of each of the bins `first` <= index < `last` of a signal."""
        place, index = self.place(name), 0
        if isinstance(place, Place) and place.source.function is not None:
            name, index = f"@{place.source.signals[0].name}", place.number
        low, high = (bins[first:last] for bins in self._extremes(name)[index])
        return low, high

    def _place(self, row: Row) -> Place:
        if row["column"] in self._made:
            source, columns, index = self._made[row["column"]]
            return Place(source.topic, source, index, columns)
        signal = Signal(row["name"], row["label"], row["unit"], row["group"], row["topic"])
        source = scaled(Scaled(signal, row["column"], row["factor"]))
        return Place(row["topic"], source, 0, source.columns)

    def _evaluate(self, text: str) -> Array:
        """Return all samples of an expression, at the times of the first signal in it."""
        expression = self._parsed(text)
        step, count = expression.start(), len(self.times(text))
        pieces = [
            self.step(expression, step, first, min(first + PIECE, count))
            for first in range(0, count, PIECE)
        ]
        return np.concatenate([np.zeros(0), *pieces])

    def _binned(self, name: str) -> list[Extremes]:
        """Return minimum and maximum of every BIN samples.

        They are of a signal, or with `@` before its name of all signals of its source.
        """
        place, name = self._made.get(name), name.removeprefix("@")
        count = len(self.times(name))
        pieces: list[list[Extremes]] = []
        for first in range(0, count, PIECE):
            last = min(first + PIECE, count)
            if place is not None:
                values = self._make(Place(place[0].topic, place[0], 0, place[1]), first, last, {})
            else:
                values = [self.values(name, first, last).astype(float, copy=False)]
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
