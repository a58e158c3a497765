"""Jobs: functions of this checkout that run in a Python process of their own.

Function and arguments are pickled to the process's standard input. Reports and result come back
as lines of JSON, so nothing made by a user's file is ever unpickled here. Any other output of the
process is kept, and its last line explains a crash. A job ends when the thread that started it
ends.
"""

from __future__ import annotations

import ctypes
import dataclasses
import json
import math
import os
import pickle
import selectors
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import IO, Any, Generic, TypeVar, cast, get_type_hints

import msgspec

from quadrotor import errors
from quadrotor.checkout import PREFIX, ROOT, RUN_MODULE

NICENESS, IDLE = 15, 19
"""Niceness of a job that no flight waits for, and of a job that nobody waits for."""
POLL = 0.1
"""Seconds between two calls of `check`."""
PIECE, PIECES = 1 << 16, 4
"""Bytes of a job's output that are read at once, and how often in one call of `poll`."""
STDERR_KEPT = 4096
"""Number of bytes of a job's output that are kept."""
PR_SET_PDEATHSIG = 1
SIGNALS = {one.value: one.name for one in signal.Signals}

T = TypeVar("T")


class Job(Generic[T]):
    """A running process; not thread-safe.

    Args:
        function: of a module, not of `__main__`; its arguments can be pickled, and its result is
            plain data or a dataclass, rebuilt here from the return annotation.
        niceness: of the process, 0 to 19.
        report: called with each value that the function reports; the function then gets, as its
            last argument, the callable with which it reports.
        keep: file descriptors that the process inherits, under the same numbers.
        longest: bytes of a report, or of the result; longer ones are lost.

    Raises JobError when it cannot be started.
    """

    def __init__(
        self,
        function: Callable[..., T],
        *arguments: Any,
        niceness: int = NICENESS,
        report: Callable[[Any], None] | None = None,
        keep: Sequence[int] = (),
        longest: int = 1 << 30,
    ) -> None:
        self._function, self._report, self._longest = function, report, longest
        self._stderr = self._partial = b""
        self._answer: dict[str, Any] = {}
        try:
            order = pickle.dumps((function, arguments, report is not None))
        except Exception as error:  # a user's own object may raise anything
            raise errors.JobError(
                f"cannot be given to another process ({error}); it must not keep a client, files "
                "or functions made in its methods"
            ) from error
        here = [] if PREFIX else [str(ROOT)]
        path = os.pathsep.join([*here, os.environ.get("PYTHONPATH", "")]).strip(os.pathsep)
        try:
            self._process = process = subprocess.Popen(
                [*RUN_MODULE, __name__, str(os.getpid()), str(niceness)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env={**os.environ, "PYTHONPATH": path},
                pass_fds=keep,
                process_group=0,  # Ctrl-C in the terminal must reach only the parent
            )
        except OSError as error:
            raise errors.JobError(f"cannot be started: {error}") from error
        self._selector = selectors.DefaultSelector()
        self._ended, self.pid = os.pidfd_open(process.pid), process.pid
        self._selector.register(self._ended, selectors.EVENT_READ)
        for stream in (process.stdout, process.stderr):
            os.set_blocking(cast(IO[bytes], stream).fileno(), False)
            self._selector.register(cast(IO[bytes], stream), selectors.EVENT_READ)
        with suppress(BrokenPipeError), cast(IO[bytes], process.stdin) as stdin:
            stdin.write(order)

    def poll(self, timeout: float = 0.0) -> bool:
        """Receive output for up to `timeout` (s); return whether the job has ended."""
        if self._ended < 0:
            return True
        self._selector.select(timeout)
        has_ended = self._process.poll() is not None
        self._receive(cast(IO[bytes], self._process.stdout), self._lines)
        self._receive(cast(IO[bytes], self._process.stderr), self._keep_stderr)
        if has_ended:
            self._close()
        return has_ended

    def result(self) -> T:
        """Wait for the end and return what the function returned.

        Raises the QuadlabError that the function raised; JobError when it was killed or crashed.
        """
        while not self.poll(POLL):
            pass
        match self._answer:  # which a plugin may have forged
            case {"error": [str(name), str(text)]}:
                kind = name if name.endswith("Error") else ""
                raise getattr(errors, kind, errors.JobError)(text)
            case {"result": value}:
                with suppress(msgspec.ValidationError):
                    return cast(T, msgspec.convert(value, get_type_hints(self._function)["return"]))
        said = self._stderr.decode(errors="replace").strip().splitlines()
        why = f": {said[-1]}" if said else ""
        raise errors.JobError(f"its process {how_it_ended(self._process.returncode)}{why}")

    def terminate(self) -> None:
        """Ask the process to end, by SIGTERM."""
        self._process.terminate()

    def stop(self, patience: float = 0.0) -> None:
        """End the process by SIGKILL; with `patience` (s), by SIGTERM before."""
        if patience:
            self.terminate()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(patience)
        self.abandon()
        self._process.wait()

    def abandon(self) -> None:
        """Kill the process without waiting; Python reaps it when the next one is started."""
        self._process.kill()
        self._close()

    def _receive(self, stream: IO[bytes], take: Callable[[bytes], None]) -> None:
        for _ in range(PIECES):  # what writes without an end must not keep the caller
            if stream.closed or (data := stream.read(PIECE)) is None:
                break
            if not data:
                self._selector.unregister(stream)
                stream.close()
            take(data)

    def _lines(self, data: bytes) -> None:
        *lines, self._partial = (self._partial[-self._longest :] + data).split(b"\n")
        for line in lines:
            answer: object = None
            with suppress(ValueError, RecursionError):  # the function wrote past its own output
                answer = json.loads(line)
            match answer:
                case {"report": value} if self._report is not None:
                    self._report(value)
                case dict():
                    self._answer = answer

    def _keep_stderr(self, data: bytes) -> None:
        self._stderr = (self._stderr + data)[-STDERR_KEPT:]

    def _close(self) -> None:
        if self._ended >= 0:
            self._selector.close()
            os.close(self._ended)
            self._ended = -1
            for stream in (self._process.stdout, self._process.stderr):
                cast(IO[bytes], stream).close()


def run(
    function: Callable[..., T],
    *arguments: Any,
    seconds: float = math.inf,
    niceness: int = NICENESS,
    check: Callable[[], None] = lambda: None,
    report: Callable[[Any], None] | None = None,
) -> T:
    """Run a job and return its result; an exception from `check` or `report` ends the job.

    Raises JobTimeoutError after `seconds`; otherwise raises as `Job` and `Job.result` do.
    """
    job = Job(function, *arguments, niceness=niceness, report=report)
    end = time.monotonic() + seconds
    try:
        while not job.poll(min(POLL, max(0.0, end - time.monotonic()))):
            check()
            if time.monotonic() >= end:
                raise errors.JobTimeoutError(f"not done after {seconds:.0f} s")
        return job.result()
    finally:
        job.stop()


def how_it_ended(code: int) -> str:
    """Return how a process ended, by its return code, as words to follow its name."""
    if code < 0:
        return f"was killed by {SIGNALS.get(-code, f'signal {-code}')}"
    return f"ended with status {code}"


def die_with_parent(parent_pid: int) -> None:
    """Let the kernel send SIGTERM to this process when the thread that started it ends."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM) != 0:
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_PDEATHSIG) failed")
    if os.getppid() != parent_pid:  # the parent ended before the call above
        sys.exit(1)


def main(parent: int, niceness: int) -> None:
    """Run the job that arrives on standard input."""
    die_with_parent(parent)
    os.nice(niceness)
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # the function's own output must not mix with the answers

    def send(kind: str, value: Any) -> None:
        print(json.dumps({kind: value}, default=dataclasses.asdict), file=answers, flush=True)

    function, arguments, reports = pickle.load(sys.stdin.buffer)
    try:
        more = [lambda value: send("report", value)] if reports else []
        send("result", function(*arguments, *more))
    except errors.QuadlabError as error:
        known = next(one for one in type(error).__mro__ if one.__module__ == errors.__name__)
        send("error", (known.__name__, " ".join(str(error).split())))
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # do not wait for threads that a user's file may have started


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
