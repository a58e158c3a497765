"""The share of a file that has been read, told to whoever waits for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

Report = Callable[[float], None]
T = TypeVar("T")
_report: ContextVar[Report] = ContextVar("report", default=lambda share: None)


def tell(share: float) -> None:
    """Tell that this share of the file has been read, 0…1; for readers of large files."""
    _report.get()(share)


@contextmanager
def told(report: Report) -> Iterator[None]:
    """Call `report` with each share that is told inside."""
    token = _report.set(report)
    try:
        yield
    finally:
        _report.reset(token)


@contextmanager
def part(begin: float, end: float) -> Iterator[None]:
    """Take what is told inside for that of a part, from `begin` to `end` of the whole."""
    whole = _report.get()
    with told(lambda share: whole(begin + (end - begin) * share)):
        yield


def each(items: Sequence[T]) -> Iterator[T]:
    """Yield items, each of which is an equal part of the whole."""
    for k, one in enumerate(items):
        with part(k / len(items), (k + 1) / len(items)):
            yield one
