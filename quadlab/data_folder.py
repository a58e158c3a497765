"""The data folder: its path, a check that it is writable, and a lock for one `up`."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import platformdirs

from quadrotor.errors import StorageError, os_errors

FREE_SPACE_FLOOR = 500_000_000
"""Bytes; with less free space the recorder stops, so nothing starts either."""


def data_folder(chosen: Path | None) -> Path:
    """Return the place of the data folder, made or not: `chosen`, else the platform's (XDG)."""
    folder = chosen or Path(platformdirs.user_data_dir("quadlab", appauthor=False))
    return folder.expanduser().absolute()


def open_data_folder(chosen: Path | None, option: str = "--data") -> Path:
    """Return the data folder, made when missing: `chosen`, else the platform's (XDG).

    Args:
        option: the command line option that chooses it, for messages.

    Raises StorageError when it is not writable or almost full.
    """
    folder = data_folder(chosen)
    hint = f"choose another with {option} DIR"
    with os_errors(lambda why: f"folder {folder} cannot be written ({why}); {hint}"):
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(b"quadlab")
    free = shutil.disk_usage(folder).free
    if free < FREE_SPACE_FLOOR:
        raise StorageError(
            f"folder {folder} has {free // 1_000_000} MB free, "
            f"{FREE_SPACE_FLOOR // 1_000_000} MB are needed; free some space or {hint}"
        )
    return folder


def owned(folder: Path) -> contextlib.AbstractContextManager[None]:
    """Lock the folder for one `quadlab up`. Raises StorageError when another has locked it."""
    return locked(
        folder / "up.lock",
        lambda owner: (
            f"another quadlab up (process {owner}) uses {folder}; "
            "stop it, or give this one its own with --data DIR, --port and --link-port"
        ),
    )


@contextlib.contextmanager
def locked(file: Path, line: Callable[[str], str], *, shared: bool = False) -> Iterator[None]:
    """Hold the lock of a file, which the kernel takes back from a process that dies.

    Args:
        line: of the error, from the number of the process that holds the lock.
        shared: whether others may hold the lock too, if theirs are shared.

    Raises StorageError when another holds it.
    """
    with open(file, "a+") as lock:
        try:
            fcntl.flock(lock, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.seek(0)
            raise StorageError(line(lock.read().strip() or "unknown")) from None
        lock.truncate(0)
        lock.write(str(os.getpid()))
        lock.flush()
        yield
