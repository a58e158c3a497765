"""Child processes are restarted, given up when they keep dying, and never outlive their parent."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from quadlab.up.supervise import RESTARTS_ALLOWED, Child
from quadrotor.errors import QuadlabError
from tests.waiting import wait_for


def station(tmp_path: Path) -> Child:
    """Return a child that stays alive: the simulator needs no other process."""
    return Child("simulator", ["simulator", "--folder", str(tmp_path), "--loopback-port", "1"])


def running(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


def test_a_killed_child_is_started_again_and_stopped_when_asked(tmp_path: Path) -> None:
    child = station(tmp_path)
    child.start()
    first = child.pid
    assert first is not None
    os.kill(first, signal.SIGKILL)
    wait_for(lambda: not running(first), what="the death")
    assert "killed by SIGKILL; started again" in (child.watch() or "")
    second = child.pid
    assert second not in (None, first)
    child.stop()
    assert child.pid is None
    assert not running(second or 0)


def test_a_child_that_keeps_dying_is_given_up_with_its_name() -> None:
    child = Child("broken", ["no_such_command"])
    child.start()
    said: list[str] = []

    def dies_for_good() -> bool:
        try:
            said.append(child.watch() or "")
        except QuadlabError as error:
            said.append(str(error))
            return True
        return False

    wait_for(dies_for_good, what="the end")
    assert sum("started again" in line for line in said) == RESTARTS_ALLOWED
    assert "broken ended with status 2 and cannot go on" in said[-1]


def test_a_child_does_not_outlive_a_killed_parent(tmp_path: Path) -> None:
    program = (
        "import sys, time\n"
        "from pathlib import Path\n"
        "from quadlab.up.supervise import Child\n"
        f"words = ['simulator', '--folder', {str(tmp_path)!r}, '--loopback-port', '1']\n"
        "child = Child('s', words)\n"
        "child.start(); print(child.pid, flush=True); sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        wait_for(lambda: (tmp_path / "mcu0").is_symlink(), what="the simulator's links")
        parent.kill()
    try:
        wait_for(lambda: not running(child), what="the child's end")
    except AssertionError:
        os.kill(child, signal.SIGKILL)
        pytest.fail("the child outlived its parent")
