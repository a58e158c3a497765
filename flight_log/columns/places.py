"""The folders in which the columns of logs are kept, and the room that they take."""

from __future__ import annotations

import os
import shutil
from contextlib import suppress
from pathlib import Path

import platformdirs
import xxhash

from flight_log.columns.writer import INDEX
from quadrotor.errors import StorageError

CACHES = ".columns"
"""Folder of the runs' columns, next to the runs."""
LARGEST = 4_000_000_000
"""Bytes of all columns in a cache folder; those looked at longest ago go first."""
ON_ITS_WAY = ".new"


def identity(log: Path) -> list[int]:
    """Return what tells a log from one that was changed. Raises StorageError."""
    try:
        status = log.stat()
    except OSError as error:
        raise StorageError(f"cannot read {log}: {error.strerror}") from error
    return [status.st_size, status.st_mtime_ns]


def place_of(log: Path) -> Path:
    """Return the folder of a log's columns; `log` is the file."""
    log = log.resolve()
    run = log.parent if (log.parent.parent / CACHES).is_dir() else log
    if (run.parent / CACHES).is_dir():
        return run.parent / CACHES / run.stem
    name = f"{log.stem[:60]}-{xxhash.xxh3_64_hexdigest(str(log).encode())}"
    return Path(platformdirs.user_cache_dir("quadlab", appauthor=False)) / "columns" / name


def make_room(folder: Path, name: str) -> bool:
    """Remove from a cache folder what killed processes have left, the columns of removed runs and,
    above LARGEST, those looked at longest ago, but not those called `name`, finished or on their
    way; return whether that was enough.
    """
    others = []
    for one in folder.glob("*"):
        if one.suffix == ON_ITS_WAY and not _is_alive(one):
            shutil.rmtree(one, ignore_errors=True)
        elif one.name != name and one.suffix != ON_ITS_WAY:
            others.append((_looked_at(one), one))
    excess = folder_bytes(folder) - LARGEST
    for looked_at, one in sorted(others):
        if looked_at and excess <= 0:
            break
        excess -= folder_bytes(one)
        shutil.rmtree(one, ignore_errors=True)
    return excess <= 0


def _is_alive(columns: Path) -> bool:
    """Return whether the process that makes these columns runs."""
    return Path("/proc", columns.stem.rpartition(".")[2]).exists()


def _looked_at(columns: Path) -> float:
    """Return when somebody last did, s; 0 for columns that are damaged or whose run is gone."""
    runs = columns.parent.parent
    run = runs / columns.name
    if columns.parent.name == CACHES and not (
        run.exists() or run.with_name(f"{run.name}.mcap").exists()
    ):
        return 0.0
    with suppress(OSError):
        return (columns / INDEX).stat().st_mtime
    return 0.0


def folder_bytes(folder: Path) -> int:
    """Return the bytes of all files below, as far as they can be seen: others may be removing
    them.
    """
    total = 0
    for root, _, names in os.walk(folder):
        for name in names:
            with suppress(OSError):
                total += os.lstat(os.path.join(root, name)).st_size
    return total
