"""The building of a replay's cache from a log: the job of web.replay.store."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

from flight_log.run import read_run
from quadrotor.errors import StorageError
from web.replay.cache_writer import COLUMNS, INDEX, Arrays, CacheWriter

READING = 0.8  # of the progress; the rest is drawing from afar


def build(log: Path, folder: Path, tell: Callable[[float], None]) -> None:
    """Build the cache of a log. Raises LogFormatError, StorageError or OSError."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    run = read_run(log, lambda share: tell(READING * share))
    with (folder / COLUMNS).open("wb") as file:
        writer = CacheWriter(
            run, Arrays(file), folder, lambda share: tell(READING + (1.0 - READING) * share)
        )
        index = writer.index()
    (folder / INDEX).write_text(json.dumps(index, allow_nan=False, separators=(",", ":")))


def build_cache(log: Path, folder: Path, report: Callable[[float], None]) -> None:
    """Build it in a job (vehicle_link.jobs). Raises LogFormatError or StorageError."""
    try:
        build(log, folder, lambda share: report(round(share, 3)))
    except OSError as error:
        raise StorageError(
            f"the replay of {log.name} cannot be written: {error.strerror or error}"
        ) from error
