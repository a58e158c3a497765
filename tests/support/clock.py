"""Clock that stops until a test sets it."""

from __future__ import annotations


class Clock:
    """Clock whose time is `now`, in s."""

    def __init__(self, now: float = 100.0) -> None:
        self.now = now

    def __call__(self) -> float:
        return self.now
