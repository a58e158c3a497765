"""An error that a thread does not handle ends the whole process, and its parent starts it again.

Without one of its threads, a process would still be there, and would no longer do that thread's
work: it might send its status and hear no command. What is out of memory ends by an error as well.
"""

from __future__ import annotations

import io
import os
import signal
import sys
import threading
import traceback
from typing import NoReturn

STATUS = 1  # of a process that ended by a defect, as Python's own


def end_at_defect() -> None:
    """Let an error that no thread handles end this process, within 1 s; to be called where a
    process begins that its parent starts again.
    """
    outlast_readers()
    threading.excepthook = _in_thread
    sys.excepthook = lambda _, error, __: end(error)
    sys.unraisablehook = _unraisable


class _Output(io.FileIO):
    def write(self, data: bytes, /) -> int:  # type: ignore[override]  # all that its buffer gives
        try:
            return super().write(data)
        except OSError:
            return len(data)


def outlast_readers() -> None:
    """Discard printed text, and end nothing, once the terminal or reader is gone."""
    for name in ("stdout", "stderr"):
        raw: io.RawIOBase = _Output(getattr(sys, name).fileno(), "w", closefd=False)
        file = io.BufferedWriter(raw)
        setattr(sys, name, io.TextIOWrapper(file, None, "backslashreplace", line_buffering=True))


def report(error: BaseException) -> None:
    """Handle an error that would have ended this thread, as if it had: for threads that others
    need, such as those of a pool.
    """
    facts = (type(error), error, error.__traceback__, threading.current_thread())
    threading.excepthook(threading.ExceptHookArgs(facts))


def end(error: BaseException) -> NoReturn:
    """End this process at once, with a traceback if there is memory for one."""
    try:
        signal.alarm(1)  # s for the traceback
        traceback.print_exception(error)
    finally:
        os._exit(STATUS)


def _in_thread(args: threading.ExceptHookArgs) -> None:
    if args.exc_type is not SystemExit:
        end(args.exc_value or args.exc_type())


def _unraisable(args: sys.UnraisableHookArgs) -> None:
    """Without memory, a thread may not even begin, and what a destructor does is left undone."""
    if isinstance(args.exc_value, MemoryError):
        end(args.exc_value)
    sys.__unraisablehook__(args)
