"""A copy of a process runs a module exactly as a new interpreter does, and shares what is there."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from quadrotor.checkout import ROOT

PARENT = """
import atexit, json, os, signal, sys, tempfile, threading
sys.path[:0] = [{root!r}, {folder!r}]
from vehicle_link import forked

forked.share([])
import imported_once
signal.signal(signal.SIGTERM, lambda *_: print("the parent's handler"))
kept = os.memfd_create("kept")
folder = tempfile.TemporaryDirectory()
atexit.register(print, "the parent ends")
if {threaded}:
    threading.Thread(target=threading.Event().wait, daemon=True).start()
child = forked.start("child", {words!r}, environment={{"GIVEN": "yes"}}, keep=[kept],
    folder=__import__("pathlib").Path({folder!r}), own_session={own_session})
print(json.dumps({{"status": child.wait(20.0), "pid": child.pid, "is_copy": forked.can_copy(),
    "folder": os.path.isdir(folder.name), "again": child.poll(), "kept": kept}}), flush=True)
folder.cleanup()
"""
CHILD = """
import json, os, signal, sys
import imported_once

facts = {
    "name": __name__,
    "words": sys.argv[1:],
    "shown": open("/proc/self/cmdline").read().split("\\0"),
    "variables": open("/proc/self/environ").read().strip("\\0").split("\\0"),
    "folder": os.getcwd(),
    "input": sys.stdin.read(),
    "given": os.environ["GIVEN"],
    "signals": [repr(signal.getsignal(n)) for n in (signal.SIGTERM, signal.SIGINT)],
    "blocked": [*signal.pthread_sigmask(signal.SIG_BLOCK, ())],
    "files": [n for n in map(int, os.listdir("/proc/self/fd")) if os.path.exists(f"/dev/fd/{n}")],
    "leads": [os.getsid(0) == os.getpid(), os.getpgrp() == os.getpid()],
}
print(json.dumps(facts), flush=True)
exec(sys.argv[1])
"""


class Started:
    """A parent that started one module, and everything that both wrote."""

    def __init__(self, folder: Path, words: list[str], threaded: bool, own_session: bool) -> None:
        (folder / "child.py").write_text(CHILD)
        (folder / "imported_once.py").write_text('print("imported")')
        program = PARENT.format(
            root=str(ROOT),
            folder=str(folder),
            words=words,
            threaded=threaded,
            own_session=own_session,
        )
        done = subprocess.run(
            [sys.executable, "-c", program],
            capture_output=True,
            text=True,
            timeout=60,
            env={"PYTHONPATH": str(folder)},
            check=False,
        )
        self.lines, self.errors = done.stdout.splitlines(), done.stderr
        facts = [json.loads(line) for line in self.lines if line.startswith("{")]
        self.facts: dict[str, Any] = facts[0]
        self.seen: dict[str, Any] = facts[1]


@pytest.mark.parametrize("own_session", [False, True])
def test_a_copy_runs_a_module_as_a_new_interpreter_does(tmp_path: Path, own_session: bool) -> None:
    words = ["pass", "--data", "a folder", ""]
    copied = Started(tmp_path, words, threaded=False, own_session=own_session)
    started = Started(tmp_path, words, threaded=True, own_session=own_session)
    assert copied.seen["is_copy"]
    assert not started.seen["is_copy"]
    assert copied.facts == started.facts
    assert "GIVEN=yes" in copied.facts["variables"]
    assert copied.facts["name"] == "__main__"
    assert copied.facts["shown"] == [sys.executable, "-m", "child", *words, ""]
    assert copied.facts["files"] == [0, 1, 2, copied.seen["kept"]]
    assert copied.facts["leads"] == [own_session, True]


def test_a_copy_imports_nothing_again_and_ends_nothing_of_its_parent(tmp_path: Path) -> None:
    copied = Started(tmp_path, ["pass"], threaded=False, own_session=False)
    started = Started(tmp_path, ["pass"], threaded=True, own_session=False)
    assert copied.lines.count("imported") == 1
    assert started.lines.count("imported") == 2
    assert copied.lines.count("the parent ends") == 1
    assert copied.seen["folder"]


@pytest.mark.parametrize(
    ("program", "status", "said"),
    [
        ("sys.exit()", 0, ""),
        ("sys.exit(3)", 3, ""),
        ("sys.exit('no port')", 1, "no port"),
        ("1 / 0", 1, "ZeroDivisionError"),
        ("os.kill(os.getpid(), 15)", -15, ""),
    ],
)
def test_a_copy_ends_with_the_status_of_its_module(
    tmp_path: Path, program: str, status: int, said: str
) -> None:
    copied = Started(tmp_path, [program], threaded=False, own_session=False)
    assert copied.seen["status"] == copied.seen["again"] == status
    assert said in copied.errors
