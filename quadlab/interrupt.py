"""Ctrl-C while the program has no command that could react: a quiet end with status 130."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType

INTERRUPTED = 130
"""Exit status of a program that Ctrl-C has ended, as shells report it."""


def is_program() -> bool:
    """Return whether this interpreter was started to run `quadlab`, by its script or by -m."""
    started_by = sys.argv[0] if sys.argv else ""
    by_module = started_by == "-m" and "quadlab" in sys.orig_argv
    return by_module or os.path.basename(started_by) == "quadlab"


def end_at_interrupt() -> None:
    """Let Ctrl-C end this process at once, without a traceback; leave it ignored where it is.

    An exception is no way to end while modules are imported: it can rise in any of them.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def raise_at_interrupt() -> None:
    """Let Ctrl-C raise KeyboardInterrupt again, for a command that catches the exception."""
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _end(number: int, frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)
