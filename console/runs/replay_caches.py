"""The replays' caches next to the runs: where they lie, what they take, gone with their run.

`web.replay` makes them, and again when asked for; nothing is lost with one.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from flight_log.columns import CACHES, folder_bytes

REPLAYS = ".replay"
"""In the folder of the runs; a cache is a folder named after its log."""


def replay_name(log: Path, runs: Path) -> str:
    """Return the name of a log's cache: a run's own name, any other log's with its folder
    (`onboard:NAME`).
    """
    is_run = log.parent.resolve() == runs.resolve()
    return log.stem if is_run else f"{log.parent.name}:{log.stem}"


def remove_replay(log: Path) -> None:
    """Remove the cache and the columns of a run. What cannot be removed is of no use, and goes with
    the oldest.
    """
    for caches in (REPLAYS, CACHES):
        shutil.rmtree(log.parent / caches / log.stem, ignore_errors=True)


def replay_bytes(runs: Path) -> int:
    """Return the bytes of all caches and columns together; those being made count."""
    return folder_bytes(runs / REPLAYS) + folder_bytes(runs / CACHES)
