"""The end of a run by a signal: rows are kept, and one line says how the rest is flown."""

from __future__ import annotations

import os
import signal
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
"""Ctrl-C, the end that a scheduler or a shutdown asks for, and a terminal that is closed."""


class StoppedBySignal(SystemExit):
    """A signal has asked for the end; the code is 128 and its number, as shells have it."""


@contextmanager
def kept_when_stopped(folder: Path) -> Iterator[None]:
    """Raise StoppedBySignal at the first of SIGNALS and ignore later ones, so that rows are written
    and workers end in order.

    A signal that is ignored, as SIGHUP below nohup, stays so. Only for the main thread.
    """

    def end(number: int, frame: FrameType | None) -> None:
        for one in before:
            signal.signal(one, signal.SIG_IGN)
        if number == signal.SIGHUP:
            _leave_terminal()
        raise StoppedBySignal(128 + number)

    before = {one: was for one in SIGNALS if (was := signal.getsignal(one)) != signal.SIG_IGN}
    for one in before:
        signal.signal(one, end)
    try:
        yield
    except StoppedBySignal as stop:
        name = signal.Signals(int(stop.code or 0) - 128).name
        line = f"quadlab: {name}: the rows so far are kept; quadlab campaign resume {folder}"
        with suppress(OSError):
            print(line, file=sys.stderr, flush=True)
        raise
    finally:
        for one, was in before.items():
            signal.signal(one, was)


def _leave_terminal() -> None:
    """Write to nowhere what would go to a terminal that may be closed."""
    for descriptor in (1, 2):
        if stat.S_ISCHR(os.fstat(descriptor).st_mode):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, descriptor)
            os.close(nowhere)
