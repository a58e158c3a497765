"""The folders in which the columns of logs are stored, and the space that they use."""

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
"""Largest size of a cache folder, in bytes; the least recently used are removed first."""
UNFINISHED = ".new"


def identity(log: Path) -> list[int]:
    """Return what distinguishes a log from a changed one: size and time. Raises StorageError."""
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
    """Remove from a cache folder the remains of killed processes, the columns of removed runs and,
    above LARGEST, the least recently used ones, but none called `name` and none being written;
    return whether that was enough.
    """
    others = []
    for one in folder.glob("*"):
        if one.suffix == UNFINISHED and not _is_alive(one):
            shutil.rmtree(one, ignore_errors=True)
        elif one.name != name and one.suffix != UNFINISHED:
            others.append((_looked_at(one), one))
    excess = folder_bytes(folder) - LARGEST
    for looked_at, one in sorted(others):
        if looked_at and excess <= 0:
            break
        excess -= folder_bytes(one)
        shutil.rmtree(one, ignore_errors=True)
    return excess <= 0


def _is_alive(columns: Path) -> bool:
    """Return whether the process that makes these columns is running."""
    return Path("/proc", columns.stem.rpartition(".")[2]).exists()


def _looked_at(columns: Path) -> float:
    """Return the time of the last use, s; 0 for damaged columns and for those of a removed run."""
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
    """Return the bytes of all files below, as far as possible: other processes may be removing
    them.
    """
    total = 0
    for root, _, names in os.walk(folder):
        for name in names:
            with suppress(OSError):
                total += os.lstat(os.path.join(root, name)).st_size
    return total
