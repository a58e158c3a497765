"""Processes of this program that begin as copies of their parent, with all that it has imported.

A copy starts without importing anything again, and the memory that neither changes exists once. A
process can only be copied while it has a single thread: a lock that another thread holds would
stay locked in the copy. Otherwise a new interpreter runs the module, to the same effect.

A copy is started and waited for without a file descriptor: a parent that has none left can still
start its processes again.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import math
import mmap
import os
import resource
import runpy
import signal
import struct
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import NoReturn, Protocol

from quadrotor.checkout import RUN_MODULE
from vehicle_link import defects

PR_SET_MM, PR_SET_MM_MAP, NO_FILE = 35, 14, 0xFFFF_FFFF
POLL = 0.005
"""Seconds between two looks whether a process has ended that is waited for."""
FILES = resource.getrlimit(resource.RLIMIT_NOFILE)
"""Limits of file descriptors with which this program began."""
_shown: list[mmap.mmap] = []
"""The command line that this process shows."""


class Process(Protocol):
    """The part of `subprocess.Popen` that a parent uses."""

    pid: int
    returncode: int

    def poll(self) -> int | None: ...
    def wait(self, timeout: float | None = None) -> int: ...
    def terminate(self) -> None: ...
    def kill(self) -> None: ...


class _Copy:
    """A copy of this process, as `Process`; `returncode` counts only once it has ended."""

    def __init__(self, pid: int) -> None:
        self.pid, self.returncode = pid, 0
        self._has_ended = False

    def poll(self) -> int | None:
        if not self._has_ended:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self._has_ended, self.returncode = True, os.waitstatus_to_exitcode(status)
        return self.returncode if self._has_ended else None

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end, without a file descriptor. Raises subprocess.TimeoutExpired."""
        end = math.inf if timeout is None else time.monotonic() + timeout
        while self.poll() is None:
            if time.monotonic() >= end:
                raise subprocess.TimeoutExpired(str(self.pid), timeout or 0.0)
            time.sleep(POLL)
        return self.returncode

    def terminate(self) -> None:
        self._send(signal.SIGTERM)

    def kill(self) -> None:
        self._send(signal.SIGKILL)

    def _send(self, number: int) -> None:
        if self.poll() is None:  # not reaped: the number is still its own
            os.kill(self.pid, number)


def can_copy() -> bool:
    """Return whether this process has a single thread."""
    # As for any folder, 2 links and those of the folders in it; counted without a file descriptor.
    return os.stat("/proc/self/task").st_nlink == 3


def share(modules: Collection[str]) -> None:
    """Import these modules for the copies to come, if this process can be copied.

    Once imported they count as permanent, so no garbage collection writes to the shared memory.
    """
    if can_copy():
        for name in modules:
            import_module(name)
        gc.collect()
        gc.freeze()


def start(
    module: str,
    arguments: Sequence[str],
    *,
    environment: Mapping[str, str] | None = None,
    keep: Collection[int] = (),
    folder: Path | None = None,
    own_session: bool = False,
) -> Process:
    """Run a module as `python -m module arguments…` would, with /dev/null as its input.

    Args:
        environment: variables to add to those of this process.
        keep: file descriptors that it inherits besides those of output, under the same numbers.
        folder: the folder that it runs in; None for this process's.
        own_session: whether it leads a session of its own, or only a group of processes. Ctrl-C in
            the terminal reaches neither.
    """
    words = [*RUN_MODULE, module, *arguments]
    if not can_copy():
        return subprocess.Popen(
            words,
            env={**os.environ, **(environment or {})},
            cwd=folder,
            stdin=subprocess.DEVNULL,
            pass_fds=keep,
            start_new_session=own_session,
            process_group=None if own_session else 0,
        )
    sys.stdout.flush()
    sys.stderr.flush()
    # No signal may reach the copy while it has our handlers.
    before = signal.pthread_sigmask(signal.SIG_SETMASK, signal.valid_signals())
    pid = os.fork()
    if pid:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        return _Copy(pid)
    try:
        _forget_parent(keep)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        (os.setsid if own_session else os.setpgrp)()
        if folder is not None:
            os.chdir(folder)
        os.environ.update(environment or {})
        _show(words)
    except BaseException:
        traceback.print_exc()
        os._exit(1)
    _run(module, arguments)


def _forget_parent(keep: Collection[int]) -> None:
    """Undo what belongs to the parent alone: handlers, files, and what it does when it exits."""
    atexit._clear()
    signal.set_wakeup_fd(-1)
    for number in signal.valid_signals():
        if callable(signal.getsignal(number)):
            signal.signal(number, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # The parent's objects of these files stay alive in its frames below, and close nothing.
    with suppress(ValueError, OSError):  # lowered for good
        resource.setrlimit(resource.RLIMIT_NOFILE, FILES)
    kept = [2, *sorted(keep), os.sysconf("SC_OPEN_MAX")]
    for before, after in pairwise(kept):
        os.closerange(before + 1, after)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)


def _run(module: str, arguments: Sequence[str]) -> NoReturn:
    """Run the module, and exit as an interpreter does, without returning to the parent's frames."""
    status: object = 1
    sys.argv = [module, *arguments]
    for name in (module, f"{module}.__main__"):
        if not hasattr(sys.modules.get(name), "__path__"):
            sys.modules.pop(name, None)  # it runs anew, as __main__
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
        status = 0
    except SystemExit as stop:
        status = stop.code
    except BaseException as error:
        defects.end(error)
    if not isinstance(status, int | None):
        sys.stderr.write(f"{status}\n")
        status = 1
    with suppress(BaseException):
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(status or 0)


def _show(words: Sequence[str]) -> None:
    """Show these words as the command line of this process, and its environment, where the kernel
    allows it.
    """
    command = b"".join(os.fsencode(word) + b"\0" for word in words)
    variables = b"".join(name + b"=" + value + b"\0" for name, value in os.environb.items())
    area = mmap.mmap(-1, len(command + variables), mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    area.write(command + variables)
    begin = ctypes.addressof(ctypes.c_char.from_buffer(area))
    fields = Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()
    code, code_end, stack, data, data_end, heap = (
        int(fields[number - 3]) for number in (26, 27, 28, 45, 46, 47)
    )
    libc = ctypes.CDLL(None)
    libc.sbrk.restype = ctypes.c_void_p
    places = (code, code_end, data, data_end, heap, libc.sbrk(ctypes.c_long(0)), stack)
    shown = (begin, begin + len(command), begin + len(command), begin + len(area))
    layout = struct.pack("=11QQII", *places, *shown, 0, 0, NO_FILE)  # prctl_mm_map of prctl(2)
    if libc.prctl(PR_SET_MM, PR_SET_MM_MAP, layout, len(layout), 0) == 0:
        _shown.append(area)
