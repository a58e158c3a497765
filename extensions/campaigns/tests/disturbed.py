"""Runs of campaigns in processes of their own, disturbed from outside."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path

from extensions.campaigns.folder import CampaignFolder
from quadrotor.errors import QuadlabError

LONGEST = 300.0
"""s within which a run ends on a busy computer."""


def started(
    *words: object, file_size: int = 0, environment: Mapping[str, str] | None = None
) -> subprocess.Popen[str]:
    """Return a process of `quadlab campaign` with more variables of the environment.

    Args:
        file_size: bytes that each of its files has at most, if given.
    """
    limits = ["prlimit", f"--fsize={file_size}"] if file_size else []
    command = [*limits, sys.executable, "-m", "quadlab", "campaign", *map(str, words)]
    return subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | (environment or {}),
    )


def workers_of(pid: int) -> list[int]:
    """Return the processes that a run has started for its flights."""
    found = []
    for one in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            parent = (one / "stat").read_text().rpartition(")")[2].split()[1]
            if int(parent) == pid and b"spawn_main" in (one / "cmdline").read_bytes():
                found.append(int(one.name))
    return found


def until(happened: Callable[[], bool], run: subprocess.Popen[str]) -> bool:
    """Wait until something has happened; return False when the run has ended before."""
    end = time.monotonic() + LONGEST
    while not happened():
        if run.poll() is not None:
            return False
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.01)
    return True


def rows_of(path: Path) -> int:
    """Return the number of rows that a run has written so far."""
    try:
        return CampaignFolder(path).count()
    except (QuadlabError, OSError, ValueError):  # not begun, or about to rename its rows
        return 0


def _has_grown(path: Path, written: int, wait: float) -> bool:
    return rows_of(path) > written and time.monotonic() > wait


def kill_workers(run: subprocess.Popen[str], path: Path, kills: int, seed: int) -> int:
    """Kill a worker at a random time after each file of rows, in the midst of flights; return how
    many were killed.
    """
    chosen, killed = random.Random(seed), 0
    while killed < kills:
        written, wait = rows_of(path), time.monotonic() + chosen.uniform(0.0, 1.0)
        if not until(partial(_has_grown, path, written, wait), run):
            break
        if workers := workers_of(run.pid):
            with suppress(ProcessLookupError):
                os.kill(chosen.choice(workers), signal.SIGKILL)
                killed += 1
    return killed
