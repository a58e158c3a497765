"""The provenance of a run: code revision, library versions, frames. For `quadlab.run`."""

from __future__ import annotations

import json
import platform
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, version

from quadrotor.checkout import PREFIX, ROOT

PACKAGES = ("numpy", "numba", "mcap", "rosbags", "eclipse-zenoh", "pydantic")
REVISION = "revision.json"
"""File of a wheel with what git says of a checkout."""


@cache
def provenance() -> dict[str, str]:
    """Return the software and computer that recorded this run, found once for each process (git
    takes 10 ms); values are text, as MCAP metadata must be.
    """
    return {
        **revision(),
        "versions": json.dumps({"python": platform.python_version(), **_versions()}),
        "frames": "world: z up; <vehicle>/body: x forward, y left, z up; quaternions body to world",
    }


def revision() -> dict[str, str]:
    """Return the revision of the sources, and whether they were changed since; "unknown" where git
    gives no answer.
    """
    if PREFIX:
        recorded: dict[str, str] = json.loads((ROOT / REVISION).read_text())
        return recorded
    found = _git("rev-parse", "HEAD")
    changes = _git("status", "--porcelain") if found else ""
    is_dirty = "unknown" if changes is None else "true" if changes else "false"
    return {"git_revision": found or "unknown", "git_dirty": is_dirty if found else ""}


def _versions() -> dict[str, str]:
    found: dict[str, str] = {}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def _git(*words: str) -> str | None:
    """Return git's output; None without git, outside a repository, and when it takes too long.

    It takes no lock, which a process that is killed would leave in the repository; and it may take
    long, as the bytes of a log must not depend on the load of the computer.
    """
    command = ["git", "--no-optional-locks", "-C", str(ROOT), *words]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=20.0, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
