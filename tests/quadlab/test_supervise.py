"""Child processes are restarted, given up when they keep dying, and never outlive their parent."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from quadlab.up import supervise
from quadlab.up.supervise import Child, stop_all
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


def test_all_are_stopped_where_there_is_no_memory_for_a_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    children = [station(tmp_path), station(tmp_path), station(tmp_path)]
    for child in children[:2]:
        child.start()
    pids = [child.pid or 0 for child in children[:2]]
    monkeypatch.setattr(threading.Thread, "start", refuse)
    stop_all(children)
    assert [child.pid for child in children] == [None, None, None]
    assert not any(running(pid) for pid in pids)


def test_a_child_that_keeps_dying_is_given_up_with_its_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(supervise, "RESTARTS_ALLOWED", 2)  # each takes a start of Python
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
    assert sum("started again" in line for line in said) == supervise.RESTARTS_ALLOWED
    assert "broken ended with status 2 and cannot go on" in said[-1]


WITHOUT_DESCRIPTORS = """
import json, os, sys, time
from quadlab.up.supervise import Child
threaded = {threaded}
if threaded:
    import threading
    threading.Thread(target=threading.Event().wait, daemon=True).start()
child = Child("simulator", ["simulator", "--folder", {folder!r}, "--loopback-port", "1"])
child.start()
taken = []
try:
    while True:
        taken.append(os.dup(0))
except OSError:
    os.kill(child.pid, 9)
lines, tries, end = [], 0, time.monotonic() + 60.0
while not any("started again" in line for line in lines) and time.monotonic() < end:
    time.sleep(0.01)
    if line := child.watch():
        lines.append(line)
    tries += child.pid is None
    if tries >= 3 and taken:
        os.closerange(taken[0], taken[-1] + 1)
        taken.clear()
child.stop()
print(json.dumps([lines, bool(taken), tries]), flush=True)
os._exit(0)
"""


@pytest.mark.parametrize("threaded", [False, True], ids=["as a copy", "as a new interpreter"])
def test_a_child_is_started_again_although_no_file_descriptor_is_left(
    tmp_path: Path, threaded: bool
) -> None:
    program = WITHOUT_DESCRIPTORS.format(folder=str(tmp_path), threaded=threaded)
    done = subprocess.run(
        ["prlimit", "--nofile=64:64", sys.executable, "-c", program],
        stdout=subprocess.PIPE,
        text=True,
        timeout=120,
        check=True,
    )
    lines, is_still_without, tries = json.loads(done.stdout.splitlines()[-1])
    if threaded:  # a new interpreter needs a descriptor: it is tried again, and told once
        first = "cannot be restarted yet: Too many open files; trying on"
        assert [line.partition("SIGKILL ")[2] for line in lines[:-1]] == [f"and {first}"]
        assert tries >= 3
    else:
        assert (is_still_without, len(lines)) == (True, 1)
    assert lines[-1] == "simulator was killed by SIGKILL; started again"


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
