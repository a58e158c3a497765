"""Signals derived by an expression of other signals: `speed = norm(state.velocity.x, …)`.

The only evaluator, live and in a replay. The name of a derived signal is its text, `LABEL [UNIT] =
EXPRESSION`; label and unit may be left out. Nothing of Python is evaluated: the text becomes a tree
of the operators and functions below.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np
import numpy.typing as npt

from quadrotor.errors import OutOfBoundsError

LONGEST = 300
"""Largest number of characters."""
DEEPEST = 40
"""Largest number of brackets and signs within each other."""
Array = npt.NDArray[np.float64]
Columns = Mapping[str, Array]
Step = Callable[[Array, Columns], Array]
"""Function of times (s) and columns of the inputs, (N,) each, that remembers the samples before."""

_RATES = {"m": "m/s", "m/s": "m/s²", "m/s²": "m/s³", "°": "°/s", "rad": "rad/s", "mm": "mm/s"}
_RATES |= {"rad/s": "rad/s²", "°/s": "°/s²", "mm/s": "mm/s²", "s": ""}
_HEAD = re.compile(r"\s*([^=\[\]()]{0,40}?)\s*(?:\[([^\[\]=]{0,12})\])?\s*=(.*)", re.DOTALL)
_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_WORD = re.compile(r"[A-Za-z_][\w./\[\]]*")


def is_expression(name: str) -> bool:
    """Return whether a signal's name is the text of a derived one."""
    return "=" in name


@dataclass(frozen=True)
class _Node:
    """Part of an expression, with the unit of its values; None if it is a plain number."""

    start: Callable[[], Step]
    unit: str | None = ""
    number: float = math.nan


@dataclass(frozen=True)
class Expression:
    """A derived signal."""

    name: str
    label: str
    unit: str
    inputs: tuple[str, ...]
    _root: _Node

    def start(self) -> Step:
        """Return a function that computes the signal from its first sample on."""
        return self._root.start()

    def described(self, topic: str) -> dict[str, Any]:
        """Return the fields that the page needs; `topic` is the one whose times it has."""
        group = {"label": self.label, "unit": self.unit, "group": "derived", "topic": topic}
        return {"name": self.name, **group}


def parse(text: str, units: Mapping[str, str]) -> Expression:
    """Parse the text of a derived signal.

    Args:
        units: name → unit of every signal that it may use.

    Raises OutOfBoundsError, which says what is wrong and where.
    """
    if len(text) > LONGEST:
        raise OutOfBoundsError(f"{len(text)} characters; an expression has at most {LONGEST}")
    found = _HEAD.fullmatch(text)
    label, unit, body = found.groups() if found else ("", None, text)
    parser = _Parser(body.strip(), units)
    root = parser.parsed()
    if not parser.inputs:
        raise OutOfBoundsError("no signal in it; write for example abs(state.velocity.z)")
    title = label or (parser.text if len(parser.text) <= 40 else f"{parser.text[:39]}…")
    given = f" [{unit}]" if unit is not None else ""
    name = f"{label}{given} = {parser.text}".strip()
    inputs = tuple(dict.fromkeys(parser.inputs))
    return Expression(name, title, (root.unit or "") if unit is None else unit, inputs, root)


def answers(
    texts: Iterable[str], describe: Callable[[str], dict[str, Any]]
) -> list[dict[str, Any]]:
    """Return what `describe` returns for each text, or what is wrong with it as `problem`."""
    found = []
    for text in texts:
        try:
            found.append(describe(text))
        except OutOfBoundsError as error:
            found.append({"name": text, "problem": str(error)})
    return found


class _Parser:
    """Recursive descent over one text; collects the signals in `inputs`."""

    def __init__(self, text: str, units: Mapping[str, str]) -> None:
        self.text, self._units = text, units
        self.inputs: list[str] = []
        self._at = self._depth = 0

    def parsed(self) -> _Node:
        node = self._sum()
        if self._peek():
            raise self._error(f"expected an operator, not {self._peek()!r}")
        return node

    def _peek(self) -> str:
        while self._at < len(self.text) and self.text[self._at].isspace():
            self._at += 1
        return self.text[self._at : self._at + 1]

    def _take(self, tokens: str) -> str:
        token = self._peek()
        if token and token in tokens:
            self._at += 1
            return token
        return ""

    def _error(self, text: str) -> OutOfBoundsError:
        return OutOfBoundsError(f"at character {self._at + 1}: {text}")

    def _sum(self) -> _Node:
        left = self._product()
        while sign := self._take("+-"):
            right = self._product()
            unit = left.unit if right.unit in (None, left.unit) else right.unit
            known = None in (left.unit, right.unit) or left.unit == right.unit
            left = _apply(
                np.add if sign == "+" else np.subtract, unit if known else "", left, right
            )
        return left

    def _product(self) -> _Node:
        left = self._signed()
        while sign := self._take("*/"):
            right = self._signed()
            unit = "" if left.unit is not None else right.unit
            if right.unit is None:
                unit = left.unit
            elif sign == "/" and left.unit is None:
                unit = ""
            left = _apply(np.multiply if sign == "*" else np.divide, unit, left, right)
        return left

    def _signed(self) -> _Node:
        self._depth += 1
        if self._depth > DEEPEST:
            raise self._error(f"more than {DEEPEST} brackets and signs within each other")
        if self._take("-"):
            inner = self._signed()
            node = _apply(np.negative, inner.unit, inner)
        else:
            node = self._atom()
            if self._take("^"):
                power = self._signed()
                node = _apply(
                    np.power, None if node.unit is power.unit is None else "", node, power
                )
        self._depth -= 1
        return node

    def _atom(self) -> _Node:
        if self._take("("):
            node = self._sum()
            self._close()
            return node
        self._peek()
        if number := _NUMBER.match(self.text, self._at):
            self._at = number.end()
            return _constant(float(number[0]))
        word = _WORD.match(self.text, self._at)
        if word is None:
            raise self._error(
                f"expected a signal, a number or '(', not {self._peek() or 'the end'}"
            )
        return self._word(word[0])

    def _close(self) -> None:
        if not self._take(")"):
            raise self._error(f"expected ')', not {self._peek() or 'the end'}")

    def _word(self, word: str) -> _Node:
        """Return the signal that the word begins with, else a function's value or a constant."""
        ends = (k for k in range(len(word), 0, -1) if not re.match(r"\w\w", word[k - 1 : k + 1]))
        name = next((word[:k] for k in ends if word[:k] in self._units), None)
        if name is not None:
            self._at += len(name)
            self.inputs.append(name)
            return _Node(lambda: lambda _, columns: columns[name], self._units[name])
        begin, called = self._at, re.match(r"\w+", word)
        assert called is not None
        self._at += called.end()
        if called[0] == "pi":
            return _constant(math.pi)
        if self._take("("):
            if called[0] not in FUNCTIONS:
                self._at = begin
                raise self._error(f"no function {called[0]}; there are {', '.join(FUNCTIONS)}")
            arguments = [self._sum()]
            while self._take(","):
                arguments.append(self._sum())
            self._close()
            return self._call(called[0], arguments)
        self._at = begin
        near = get_close_matches(word, self._units, 3)
        raise self._error(
            f"no signal {word:.80}" + (f"; did you mean {' or '.join(near)}?" if near else "")
        )

    def _call(self, name: str, arguments: list[_Node]) -> _Node:
        least, most, make = FUNCTIONS[name]
        if not least <= len(arguments) <= most:
            wanted = f"{least}" if least == most else f"{least} or more"
            raise self._error(f"{name} takes {wanted} arguments, not {len(arguments)}")
        try:
            return make(*arguments)
        except OutOfBoundsError as error:
            raise self._error(f"{name} {error}") from None


def _constant(value: float) -> _Node:
    return _Node(lambda: lambda times, _: np.full(len(times), value), None, value)


def _apply(function: Callable[..., Any], unit: str | None, *arguments: _Node) -> _Node:
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
    return _Node(start, unit, number)


def _remembering(
    make: Callable[[], Callable[[Array, Array], Array]], unit: str, of: _Node
) -> _Node:
    """Return the node of a function that remembers samples: `make` returns it without any."""

    def start() -> Step:
        inner, function = of.start(), make()
        return lambda times, columns: function(times, inner(times, columns))

    return _Node(start, unit)


def _same(function: Callable[..., Any]) -> Callable[..., _Node]:
    return lambda *of: _apply(function, next((one.unit for one in of if one.unit), of[0].unit), *of)


def _plain(function: Callable[..., Any], unit: str = "") -> Callable[..., _Node]:
    return lambda *of: _apply(function, None if of[0].unit is None else unit, *of)


def _norm(*values: Array) -> Any:
    return np.sqrt(sum(value * value for value in values))


def _diff(of: _Node) -> _Node:
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


def _integral(of: _Node) -> _Node:
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


def _lowpass(of: _Node, cutoff: _Node) -> _Node:
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
FUNCTIONS: dict[str, tuple[int, int, Callable[..., _Node]]] = {
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
