"""The provenance of a run: code revision, library versions, frames. For `quadlab.run`."""

from __future__ import annotations

import json
import platform
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = ("numpy", "numba", "mcap", "rosbags", "eclipse-zenoh", "pydantic")
REPOSITORY = Path(__file__).parents[1]


@cache
def provenance() -> dict[str, str]:
    """Return what recorded this run, found once for each process (git takes 10 ms); values are
    text, as MCAP metadata must be.
    """
    revision = _git("rev-parse", "HEAD")
    return {
        "git_revision": revision or "unknown",
        "git_dirty": ("true" if _git("status", "--porcelain") else "false") if revision else "",
        "versions": json.dumps({"python": platform.python_version(), **_versions()}),
        "frames": "world: z up; <vehicle>/body: x forward, y left, z up; quaternions body to world",
    }


def _versions() -> dict[str, str]:
    found: dict[str, str] = {}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def _git(*words: str) -> str:
    """Return git's output; empty without git or outside a repository, as in an installed copy."""
    try:
        done = subprocess.run(
            ["git", "-C", str(REPOSITORY), *words],
            capture_output=True,
            text=True,
            timeout=2.0,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
