"""The command line argument that names a log, and the progress of reading one."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import tyro

from quadrotor.errors import StorageError

LogFile = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="LOG")]


def check_log_file(path: Path) -> None:
    """Raise StorageError when there is no such file, or it cannot be read."""
    if not path.exists():
        raise StorageError(f"{path} is not a file; give the path of an .mcap file")
    from flight_log.file import open_log

    with open_log(path):
        pass


@contextmanager
def progress_of(what: str) -> Iterator[Callable[[float], None]]:
    """Yield a function to call with the share done, 0…1; shown on stderr, only on a terminal."""
    if not sys.stderr.isatty():
        yield lambda share: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda share: bar.update(task, completed=share)
