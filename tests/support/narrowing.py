"""Workaround for mypy's narrowing of an asserted attribute."""

from __future__ import annotations

from typing import TypeVar

T = TypeVar("T")


def now(thing: T) -> T:
    """Return `thing` after an action: mypy assumes that an asserted attribute does not change."""
    return thing
