"""Functions of the expressions of derived signals, with the units of what they return."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from quadrotor.errors import OutOfBoundsError

Array = npt.NDArray[np.float64]
Columns = Mapping[str, Array]
Step = Callable[[Array, Columns], Array]
"""Function of times (s) and columns of the inputs, (N,) each, that remembers the samples before."""

_RATES = {"m": "m/s", "m/s": "m/s²", "m/s²": "m/s³", "°": "°/s", "rad": "rad/s", "mm": "mm/s"}
_RATES |= {"rad/s": "rad/s²", "°/s": "°/s²", "mm/s": "mm/s²", "s": ""}


@dataclass(frozen=True)
class Node:
    """Part of an expression, with the unit of its values; None if it is a plain number."""

    start: Callable[[], Step]
    unit: str | None = ""
    number: float = math.nan


def constant(value: float) -> Node:
    return Node(lambda: lambda times, _: np.full(len(times), value), None, value)


def applied(function: Callable[..., Any], unit: str | None, *arguments: Node) -> Node:
    """Return the node of a function of each sample by itself."""

    def start() -> Step:
        steps = [one.start() for one in arguments]

        def step(times: Array, columns: Columns) -> Array:
            with np.errstate(all="ignore"):
                values: Array = function(*(one(times, columns) for one in steps))
            return values

        return step

    number = math.nan
    if all(one.unit is None for one in arguments):
        with np.errstate(all="ignore"):
            number = float(function(*(np.float64(one.number) for one in arguments)))
    return Node(start, unit, number)


def _remembering(make: Callable[[], Callable[[Array, Array], Array]], unit: str, of: Node) -> Node:
    """Return the node of a function that remembers samples: `make` returns it without any."""

    def start() -> Step:
        inner, function = of.start(), make()
        return lambda times, columns: function(times, inner(times, columns))

    return Node(start, unit)


def _same(function: Callable[..., object]) -> Callable[..., Node]:
    return lambda *of: applied(
        function, next((one.unit for one in of if one.unit), of[0].unit), *of
    )


def _plain(function: Callable[..., object], unit: str = "") -> Callable[..., Node]:
    return lambda *of: applied(function, None if of[0].unit is None else unit, *of)


def _norm(*values: Array) -> object:
    return np.sqrt(sum(value * value for value in values))


def _diff(of: Node) -> Node:
    def make() -> Callable[[Array, Array], Array]:
        last = (math.nan, math.nan)

        def step(times: Array, values: Array) -> Array:
            nonlocal last
            if not len(times):
                return values
            change = np.diff(times, prepend=last[0])
            with np.errstate(all="ignore"):
                rate: Array = np.diff(values, prepend=last[1]) / np.where(
                    change > 0, change, np.nan
                )
            last = float(times[-1]), float(values[-1])
            return rate

        return step

    return _remembering(make, _RATES.get(of.unit or "", ""), of)


def _integral(of: Node) -> Node:
    """Return the node of the trapezoidal sum from the first sample on; a gap adds nothing."""

    def make() -> Callable[[Array, Array], Array]:
        last, total = (math.nan, math.nan), 0.0

        def step(times: Array, values: Array) -> Array:
            nonlocal last, total
            if not len(times):
                return values
            before = np.concatenate([[last[1]], values[:-1]])
            parts = 0.5 * (before + values) * np.diff(times, prepend=last[0])
            sums: Array = total + np.cumsum(np.where(np.isfinite(parts), parts, 0.0))
            last, total = (float(times[-1]), float(values[-1])), float(sums[-1])
            return sums

        return step

    units = {rate: unit for unit, rate in _RATES.items() if rate}
    return _remembering(make, units.get(of.unit or "", ""), of)


def _lowpass(of: Node, cutoff: Node) -> Node:
    """Return the node of a low-pass filter of the first order, discretised exactly."""
    if not 0.0 < cutoff.number < math.inf:
        raise OutOfBoundsError("needs its cut-off in Hz as second argument, above 0: lowpass(…, 2)")

    def make() -> Callable[[Array, Array], Array]:
        last = filtered = math.nan

        def step(times: Array, values: Array) -> Array:
            nonlocal last, filtered
            kept = []
            for time, value in zip(times.tolist(), values.tolist(), strict=True):
                if math.isfinite(value):
                    passed = 0.0 if math.isnan(last) else max(0.0, time - last)
                    share = -math.expm1(-2.0 * math.pi * cutoff.number * passed)
                    begins = math.isnan(filtered)
                    filtered = value if begins else filtered + share * (value - filtered)
                    last = time
                kept.append(filtered if math.isfinite(value) else math.nan)
            return np.array(kept)

        return step

    return _remembering(make, of.unit or "", of)


MANY = 8
FUNCTIONS: dict[str, tuple[int, int, Callable[..., Node]]] = {
    "abs": (1, 1, _same(np.abs)),
    "min": (2, MANY, _same(lambda *values: np.minimum.reduce(values))),
    "max": (2, MANY, _same(lambda *values: np.maximum.reduce(values))),
    "norm": (1, MANY, _same(_norm)),
    "sign": (1, 1, _plain(np.sign)),
    "sqrt": (1, 1, _plain(np.sqrt)),
    "exp": (1, 1, _plain(np.exp)),
    "log": (1, 1, _plain(np.log)),
    "sin": (1, 1, _plain(np.sin)),
    "cos": (1, 1, _plain(np.cos)),
    "tan": (1, 1, _plain(np.tan)),
    "atan2": (2, 2, _plain(np.arctan2, "rad")),
    "deg": (1, 1, _plain(np.degrees, "°")),
    "rad": (1, 1, _plain(np.radians, "rad")),
    "diff": (1, 1, _diff),
    "integral": (1, 1, _integral),
    "lowpass": (2, 2, _lowpass),
}
"""Name → least and largest number of arguments, and the function that makes the node.

Trigonometric functions take rad. `diff` is the rate of change, `integral` begins with the first
sample, `lowpass` has its cut-off in Hz.
"""
