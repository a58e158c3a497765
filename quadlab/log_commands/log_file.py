"""The word that names a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from quadrotor.errors import StorageError

LogFile = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="LOG")]


def check_log_file(path: Path) -> None:
    """Raises StorageError when there is no such file."""
    if not path.is_file():
        what = "a folder" if path.is_dir() else "no file"
        raise StorageError(f"{path} is {what}; give the path of an .mcap file")
