"""The share of a file that has been read, told to whoever waits for it, and the time that it may
take.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TypeVar

from quadrotor.errors import LogFormatError

Report = Callable[[float], None]
T = TypeVar("T")
LEAST_S, SECONDS_A_BYTE = 25.0, 3e-7
"""Processor time that any file may take, and more for each byte: three times the slowest."""
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
    """Report the progress made inside as a part, from `begin` to `end`, of the whole."""
    whole = _report.get()
    with told(lambda share: whole(begin + (end - begin) * share)):
        yield


def each(items: Sequence[T]) -> Iterator[T]:
    """Yield items, each of which is an equal part of the whole."""
    for k, one in enumerate(items):
        with part(k / len(items), (k + 1) / len(items)):
            yield one


@contextmanager
def bounded_time(paths: Sequence[Path]) -> Iterator[None]:
    """Raise LogFormatError inside after more processor time than files of their size can take, as
    one does whose descriptions contain each other many times. For the main thread only.
    """
    files = [file for one in paths for file in (one, *one.glob("*")) if file.exists()]
    most = LEAST_S + SECONDS_A_BYTE * sum(one.stat().st_size for one in files)

    def stop(*_: object) -> None:
        raise LogFormatError(
            f"{paths[0].name} takes more than {most:.0f} s of processor time, more than any file "
            "of its size: do its descriptions contain each other?"
        )

    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, most, 1.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
