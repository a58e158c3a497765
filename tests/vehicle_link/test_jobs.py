"""A job's answer, its reports, its end by any cause, and the messages about it."""

from __future__ import annotations

import fcntl
import math
import os
import signal
import stat
import struct
import subprocess
import sys
import termios
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from quadrotor.checkout import ROOT
from quadrotor.errors import JobError, JobTimeoutError, RefusedError, StorageError
from tests.waiting import until
from vehicle_link.jobs import PIECE, PIECES, STDERR_KEPT, Job, how_it_ended, run

BOUND = 60.0
SET_PIPE_SIZE = 1031
"""F_SETPIPE_SZ of fcntl(2)."""


@dataclass(frozen=True)
class Found:
    name: str
    values: tuple[float, ...]


class FullError(StorageError):
    """Error of a module that the parent need not have."""


def find(name: str, report: Callable[[object], None]) -> Found:
    print("what it prints does not come between")
    report(0.5)
    report({"lines": ["a"]})
    return Found(name, (1.0, math.inf))


def niceness() -> int:
    return os.nice(0)


def refuse() -> None:
    raise FullError("no room,\ntry again")


def die(how: str) -> None:
    print("x" * 100_000, file=sys.stderr)
    print("the last line", file=sys.stderr, flush=True)
    if how == "exit":
        os._exit(3)
    os.kill(os.getpid(), getattr(signal, how))


def forge(line: str) -> int:
    """Write a line to each pipe that is open, as a plugin may, and end."""
    for number in map(int, os.listdir("/proc/self/fd")):
        with suppress(OSError):
            if number > 2 and stat.S_ISFIFO(os.fstat(number).st_mode):
                os.write(number, line.encode() + b"\n")
    os._exit(0)


def fill(file: str) -> None:
    fcntl.fcntl(2, SET_PIPE_SIZE, 1 << 20)
    os.write(2, bytes(1 << 20))
    wait(file)


def long_text() -> str:
    return "x" * 200_000


def wait(file: str) -> None:
    Path(file).write_text(str(os.getpid()))
    threading.Event().wait(BOUND)


def leave_a_child() -> int:
    return subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE).pid


def start_and_be_killed(file: str) -> None:
    Job(wait, file)
    while not Path(file).exists() or not Path(file).read_text():
        pass
    os.kill(os.getpid(), signal.SIGKILL)


def is_gone(file: Path) -> bool:
    stat = Path(f"/proc/{file.read_text()}/stat")
    return not stat.exists() or stat.read_text().rsplit(") ", 1)[1][0] == "Z"


def test_a_job_reports_and_returns_what_its_function_does() -> None:
    told: list[object] = []
    assert run(find, "mine", report=told.append) == Found("mine", (1.0, math.inf))
    assert told == [0.5, {"lines": ["a"]}]


def test_a_job_has_the_niceness_asked_for() -> None:
    assert run(niceness, niceness=19) == 19


def test_what_the_function_raises_is_raised_here_as_the_kind_known_to_all_in_one_line() -> None:
    with pytest.raises(StorageError, match=r"^no room, try again$") as caught:
        run(refuse)
    assert type(caught.value) is StorageError


@pytest.mark.parametrize(
    ("how", "told"),
    [("exit", "status 3"), ("SIGKILL", "killed by SIGKILL"), ("SIGSEGV", "killed by SIGSEGV")],
)
def test_a_crash_is_told_with_its_last_line(how: str, told: str) -> None:
    job = Job(die, how)
    with pytest.raises(JobError, match=f"{told}: the last line$"):
        job.result()
    assert len(job._stderr) <= STDERR_KEPT


def test_a_signal_without_a_name_is_told_by_its_number() -> None:
    assert how_it_ended(-40) == "was killed by signal 40"


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ('{"error": 5}', "status 0"),
        ('{"error": [[1], {}]}', "status 0"),
        ('{"error": ["annotations", "mine"]}', "^mine$"),
        ('{"result": "no number"}', "status 0"),
    ],
)
def test_a_forged_answer_is_the_jobs_error(line: str, told: str) -> None:
    with pytest.raises(JobError, match=told):
        run(forge, line)


def test_what_is_written_without_an_end_is_taken_in_parts(tmp_path: Path) -> None:
    file = tmp_path / "pid"
    job = Job(fill, str(file))
    until(lambda: file.exists() and file.read_text())
    job.poll()
    assert job._process.stderr is not None
    left = fcntl.ioctl(job._process.stderr.fileno(), termios.FIONREAD, bytes(4))
    assert struct.unpack("i", left)[0] == (1 << 20) - PIECES * PIECE
    job.stop()


def test_a_result_longer_than_is_allowed_is_lost() -> None:
    assert len(Job(long_text).result()) == 200_000
    with pytest.raises(JobError, match="its process ended with status 0"):
        Job(long_text, longest=1000).result()


def test_a_defect_is_told_by_its_exception() -> None:
    with pytest.raises(JobError, match="status 1: ZeroDivisionError"):
        run(divmod, 1, 0)


def test_a_job_has_its_time_and_can_be_ended(tmp_path: Path) -> None:
    file = tmp_path / "pid"
    with pytest.raises(JobTimeoutError, match="not done after 0 s"):
        run(wait, str(file), seconds=0.2)

    def check() -> None:
        if file.exists() and file.read_text():
            raise RefusedError("cancelled")

    file.unlink(missing_ok=True)
    with pytest.raises(RefusedError):
        run(wait, str(file), seconds=BOUND, check=check)
    assert is_gone(file)


def test_a_job_that_is_asked_to_end_does(tmp_path: Path) -> None:
    job = Job(wait, str(tmp_path / "pid"))
    job.stop(BOUND)
    assert job.poll()
    with pytest.raises(JobError, match="SIGTERM"):
        job.result()


def test_a_job_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    file = tmp_path / "pid"
    with pytest.raises(JobError, match="SIGKILL"):
        run(start_and_be_killed, str(file), seconds=BOUND)
    assert until(lambda: is_gone(file))


def test_a_process_it_leaves_behind_does_not_hold_its_answer() -> None:
    os.kill(run(leave_a_child, seconds=BOUND), signal.SIGKILL)


def test_what_cannot_be_given_to_another_process_is_refused() -> None:
    with pytest.raises(JobError, match="cannot be given"):
        run(niceness, lambda: None)


def test_it_is_found_from_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.chdir(tmp_path)
    assert run(find, "far", report=lambda told: None).name == "far"
