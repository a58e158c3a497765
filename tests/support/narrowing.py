"""A way to have mypy forget what an assertion said of an attribute."""

from __future__ import annotations

from typing import TypeVar

T = TypeVar("T")


def now(thing: T) -> T:
    """Return `thing` after an action: mypy takes an attribute asserted before it for constant."""
    return thing
