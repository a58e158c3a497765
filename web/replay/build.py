"""The building of a replay's cache from a log: the job of web.replay.store."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

from flight_log.gathered import Topic
from flight_log.run import read_run
from flight_log.topic_columns import ColumnReader
from quadrotor.errors import LogFormatError, StorageError
from web.replay import timeline
from web.replay.cache_writer import COLUMNS, INDEX, Arrays, CacheWriter

MOST_COLUMNS = 4000
MOST_MESSAGES = 12_000_000
"""Their times and order are held."""
READING = 0.8  # of the progress; the rest is sorting


def build(log: Path, folder: Path, tell: Callable[[float], None]) -> None:
    """Build the cache of a log. Raises LogFormatError, StorageError or OSError."""
    scratch = folder / "scratch"
    shutil.rmtree(folder, ignore_errors=True)
    scratch.mkdir(parents=True)

    def look(topics: dict[str, Topic], share: float) -> None:
        if (count := sum(map(len, topics.values()))) > MOST_MESSAGES:
            raise LogFormatError(
                f"{log.name} has more than {count} messages; at most {MOST_MESSAGES} are replayed: "
                "cut it with `mcap filter --output-compression lz4 --start … --end …`"
            )
        tell(READING * share)

    reader = ColumnReader(log, timeline.WHOLE)
    run = read_run(reader, look, folder=scratch, most_columns=MOST_COLUMNS)
    with (folder / COLUMNS).open("wb") as file:
        writer = CacheWriter(
            run, Arrays(file), folder, lambda share: tell(READING + (1.0 - READING) * share)
        )
        index = writer.index()
    shutil.rmtree(scratch)
    (folder / INDEX).write_text(json.dumps(index, allow_nan=False, separators=(",", ":")))


def build_cache(log: Path, folder: Path, report: Callable[[float], None]) -> None:
    """Build it in a job (vehicle_link.jobs). Raises LogFormatError or StorageError."""
    try:
        build(log, folder, lambda share: report(round(share, 3)))
    except OSError as error:
        raise StorageError(
            f"the replay of {log.name} cannot be written: {error.strerror or error}"
        ) from error
