"""The command line argument that names a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from quadrotor.errors import StorageError

LogFile = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="LOG")]


def check_log_file(path: Path) -> None:
    """Raise StorageError when there is no such file, or it cannot be read."""
    if not path.exists():
        raise StorageError(f"{path} is no file; give the path of an .mcap file")
    from flight_log.file import open_log

    open_log(path).close()
