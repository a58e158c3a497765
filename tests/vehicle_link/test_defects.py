"""A process ends at once when one of its threads ends by an error, whatever it is doing."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from quadrotor.checkout import ROOT
from vehicle_link import defects
from vehicle_link.transport.executor_queue import ExecutorQueue

PROGRAM = """
import sys, threading, time
from concurrent.futures import ThreadPoolExecutor
from vehicle_link.defects import end_at_defect
from vehicle_link.transport.executor_queue import ExecutorQueue
end_at_defect()
kept = threading.Thread(target=time.sleep, args=(300.0,))  # Python would wait for it
kept.start()
def fail(error=MemoryError("full")):
    raise error
{act}
if {waits}:
    time.sleep(300.0)
"""


@pytest.mark.parametrize(
    ("act", "said"),
    [
        ("threading.Thread(target=fail).start()", "MemoryError: full"),
        ("ExecutorQueue(ThreadPoolExecutor(1), fail).put(OSError('gone'))", "OSError: gone"),
        ("fail()", "MemoryError: full"),
        ("import _thread; _thread.start_new_thread(fail, ())", "MemoryError: full"),
        (
            "class Mute:\n    def write(self, text): raise MemoryError\n"
            "sys.stderr = Mute()\nthreading.Thread(target=fail).start()",
            "",
        ),
    ],
    ids=[
        "a thread",
        "a thread of a pool",
        "the main thread",
        "a bare thread",
        "without memory for a traceback",
    ],
)
def test_a_process_ends_with_a_thread_that_fails(act: str, said: str) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(act=act, waits=act != "fail()")],
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert ended.returncode == defects.STATUS, ended.stderr
    assert said in ended.stderr


def test_a_thread_may_end_by_itself() -> None:
    act = "threading.Thread(target=sys.exit).start()\nthreading.Event().wait(0.2)\nimport os\n"
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(act=act + "os._exit(0)", waits=True)],
        cwd=ROOT,
        timeout=60.0,
        check=False,
    )
    assert ended.returncode == 0


def test_a_queue_outlasts_an_error_of_its_handler(monkeypatch: pytest.MonkeyPatch) -> None:
    """The queue is not deaf where a defect does not end the process, as in a notebook."""
    told: list[Any] = []
    monkeypatch.setattr("threading.excepthook", lambda args: told.append(args.exc_type))
    handled: list[int] = []

    def handle(item: int) -> None:
        if item == 0:
            raise MemoryError
        handled.append(item)

    with ThreadPoolExecutor(1) as pool:
        items = ExecutorQueue(pool, handle)
        for item in range(3):
            items.put(item)
    assert (handled, told) == ([1, 2], [MemoryError])


PRINTS = """
import os, pty, sys
from vehicle_link.defects import end_at_defect
terminal, other = pty.openpty()
if {is_terminal}:
    os.dup2(other, 1)
    os.dup2(other, 2)
    os.close(other)
end_at_defect()
print("heard", flush=True)
if {is_terminal}:
    os.close(terminal)
sys.stdin.read()
for _ in range(3):
    print("lost", flush=True)
    print("lost", file=sys.stderr, flush=True)
os._exit(7)
"""


@pytest.mark.parametrize("is_terminal", [True, False])
def test_lines_that_nobody_reads_any_more_end_nothing(is_terminal: bool) -> None:
    pipe = subprocess.PIPE
    program = [sys.executable, "-c", PRINTS.format(is_terminal=is_terminal)]
    with subprocess.Popen(program, stdin=pipe, stdout=pipe, stderr=pipe, cwd=ROOT) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == (b"" if is_terminal else b"heard\n")
        for end in (child.stdout, child.stderr, child.stdin):
            assert end is not None
            end.close()
        assert child.wait(60.0) == 7
