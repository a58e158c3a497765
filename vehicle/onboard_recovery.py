"""Onboard logs whose writer was killed: found and mended at the next start."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from quadrotor.errors import QuadlabError
from vehicle_link.log import is_closed, recover
from vehicle_link.log.file import is_being_written
from vehicle_link.log.file_index import holds_nothing

FOLDER = "onboard"
"""Inside the data folder."""


def torn_logs(data: Path) -> list[Path]:
    """Onboard logs that were never closed. Raises StorageError."""
    folder = data / FOLDER
    return [path for path in sorted(folder.glob("*.mcap")) if not is_closed(path)]


def recover_logs(paths: list[Path]) -> Iterator[str]:
    """Mend each; yields one line a file. A file that cannot be mended stays as it is."""
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
