"""Onboard logs that were not closed: found and repaired, at the next start or on the ground."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from flight_log import is_closed, recover
from flight_log.file import is_being_written
from flight_log.index import holds_nothing
from quadrotor.errors import QuadlabError

FOLDER = "onboard"
"""Name of the folder in the data folder."""


def torn_logs(data: Path) -> list[Path]:
    """Return the onboard logs that were never closed. Raises StorageError."""
    folder = data / FOLDER
    return [path for path in sorted(folder.glob("*.mcap")) if not is_closed(path)]


def recover_logs(paths: list[Path]) -> Iterator[str]:
    """Repair each file and yield one line for it. A file that cannot be repaired is unchanged."""
    for path in paths:
        try:
            if holds_nothing(path) and not is_being_written(path):
                path.unlink()
                yield f"onboard log {path.name} removed: it holds nothing, its writer was killed"
                continue
            found = recover(path)
        except (QuadlabError, OSError) as error:
            yield f"onboard log {path.name} not recovered: {error}"
        else:
            if found.torn:
                yield f"onboard log {path.name} recovered: {found.messages} messages"


def mend_logs(paths: list[Path], report: Callable[[str], None]) -> None:
    """Repair logs in a separate process; SIGTERM leaves a torn file unchanged."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    for line in recover_logs(paths):
        report(line)
