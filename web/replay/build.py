"""The building of a replay's cache from a log, in a process of its own at low priority.

`python -m web.replay.build LOG FOLDER` writes FOLDER (web.replay.cache_writer) and prints one line
of JSON after each block: {"progress": 0 to 1}, at the end {"done": true} or {"error": reason}. It
ends when its standard input is closed, so that none is left behind by a page's process that died.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from flight_log.gathered import Topic
from flight_log.run import read_run
from flight_log.topic_columns import ColumnReader
from quadrotor.errors import LogFormatError, QuadlabError
from web.replay import timeline
from web.replay.cache_writer import COLUMNS, INDEX, Arrays, CacheWriter

NICENESS = 10
"""Below everything that flies; somebody waits for it all the same."""
MOST_COLUMNS = 4000
MOST_MESSAGES = 12_000_000
"""Their times and order are held."""
READING = 0.8  # of the progress; the rest is sorting


def build(log: Path, folder: Path, tell: Callable[[float], None]) -> None:
    """Raise LogFormatError, StorageError or OSError."""
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


def _end_with_parent() -> None:
    while os.read(0, 64):
        pass
    os._exit(1)


def main() -> int:
    log, folder = Path(sys.argv[1]), Path(sys.argv[2])
    os.nice(NICENESS)
    threading.Thread(target=_end_with_parent, daemon=True).start()

    def say(**fields: Any) -> None:
        print(json.dumps(fields), flush=True)

    try:
        build(log, folder, lambda share: say(progress=round(share, 3)))
    except QuadlabError as error:
        say(error=str(error))
    except OSError as error:
        say(error=f"the replay of {log.name} cannot be written: {error.strerror or error}")
    else:
        say(done=True)
        return 0
    shutil.rmtree(folder, ignore_errors=True)
    return 1


if __name__ == "__main__":
    sys.exit(main())
