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

import numpy as np

from quadrotor.errors import OutOfBoundsError
from quadrotor.similar_names import did_you_mean
from web.signals.functions import FUNCTIONS, Node, Step, applied, constant

LONGEST = 300
"""Largest number of characters."""
DEEPEST = 40
"""Largest number of nested brackets and signs."""
_HEAD = re.compile(r"\s*([^=\[\]()]{0,40}?)\s*(?:\[([^\[\]=]{0,12})\])?\s*=(.*)", re.DOTALL)
_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_WORD = re.compile(r"[A-Za-z_][\w./\[\]]*")


def is_expression(name: str) -> bool:
    """Return whether a signal's name is the text of a derived one."""
    return "=" in name


@dataclass(frozen=True)
class Expression:
    """A derived signal."""

    name: str
    label: str
    unit: str
    inputs: tuple[str, ...]
    _root: Node

    def start(self) -> Step:
        """Return a function that computes the signal from its first sample on."""
        return self._root.start()

    def described(self, topic: str) -> dict[str, object]:
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
    texts: Iterable[str], describe: Callable[[str], dict[str, object]]
) -> list[dict[str, object]]:
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

    def parsed(self) -> Node:
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

    def _sum(self) -> Node:
        left = self._product()
        while sign := self._take("+-"):
            right = self._product()
            unit = left.unit if right.unit in (None, left.unit) else right.unit
            known = None in (left.unit, right.unit) or left.unit == right.unit
            left = applied(
                np.add if sign == "+" else np.subtract, unit if known else "", left, right
            )
        return left

    def _product(self) -> Node:
        left = self._signed()
        while sign := self._take("*/"):
            right = self._signed()
            unit = "" if left.unit is not None else right.unit
            if right.unit is None:
                unit = left.unit
            elif sign == "/" and left.unit is None:
                unit = ""
            left = applied(np.multiply if sign == "*" else np.divide, unit, left, right)
        return left

    def _signed(self) -> Node:
        self._depth += 1
        if self._depth > DEEPEST:
            raise self._error(f"more than {DEEPEST} nested brackets and signs")
        if self._take("-"):
            inner = self._signed()
            node = applied(np.negative, inner.unit, inner)
        else:
            node = self._atom()
            if self._take("^"):
                power = self._signed()
                node = applied(
                    np.power, None if node.unit is power.unit is None else "", node, power
                )
        self._depth -= 1
        return node

    def _atom(self) -> Node:
        if self._take("("):
            node = self._sum()
            self._close()
            return node
        self._peek()
        if number := _NUMBER.match(self.text, self._at):
            self._at = number.end()
            return constant(float(number[0]))
        word = _WORD.match(self.text, self._at)
        if word is None:
            raise self._error(
                f"expected a signal, a number or '(', not {self._peek() or 'the end'}"
            )
        return self._word(word[0])

    def _close(self) -> None:
        if not self._take(")"):
            raise self._error(f"expected ')', not {self._peek() or 'the end'}")

    def _word(self, word: str) -> Node:
        """Return the signal that the word begins with, else a function's value or a constant."""
        ends = (k for k in range(len(word), 0, -1) if not re.match(r"\w\w", word[k - 1 : k + 1]))
        name = next((word[:k] for k in ends if word[:k] in self._units), None)
        if name is not None:
            self._at += len(name)
            self.inputs.append(name)
            return Node(lambda: lambda _, columns: columns[name], self._units[name])
        begin, called = self._at, re.match(r"\w+", word)
        assert called is not None
        self._at += called.end()
        if called[0] == "pi":
            return constant(math.pi)
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
        hint = did_you_mean(word, self._units, before="; ")
        raise self._error(f"no signal {word:.80}{hint}")

    def _call(self, name: str, arguments: list[Node]) -> Node:
        least, most, make = FUNCTIONS[name]
        if not least <= len(arguments) <= most:
            wanted = f"{least}" if least == most else f"{least} or more"
            raise self._error(f"{name} takes {wanted} arguments, not {len(arguments)}")
        try:
            return make(*arguments)
        except OutOfBoundsError as error:
            raise self._error(f"{name} {error}") from None
