"""Folders for what is not finished, removed also after a process that was killed."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from quadrotor.errors import os_errors

UNHELD = ".new"


@contextmanager
def working_folder(parent: Path, prefix: str) -> Iterator[Path]:
    """Yield a new folder, removed in the end; those of this user's killed processes go first.

    Its process holds the folder's lock, which the kernel takes back from one that dies. Raises
    StorageError when it cannot be made.
    """
    _remove_leftovers(parent, prefix)
    with os_errors(lambda why: f"cannot write in {parent}: {why}"):
        made = Path(tempfile.mkdtemp(prefix=f"{UNHELD}{prefix}", dir=parent))
        held = os.open(made, os.O_RDONLY)
        with suppress(OSError):  # a file system without locks: nobody can lock it there
            fcntl.flock(held, fcntl.LOCK_EX)
        # Nobody takes it for a leftover before it is locked.
        folder = made.rename(made.with_name(made.name.removeprefix(UNHELD)))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(held)


def _remove_leftovers(parent: Path, prefix: str) -> None:
    for path in parent.glob(f"{prefix}*"):
        try:
            found = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        except OSError:  # another user's, or removed in the meantime
            continue
        try:
            if os.fstat(found).st_uid == os.getuid():
                fcntl.flock(found, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(path, ignore_errors=True)
        except OSError:  # its process lives, or the file system has no locks
            continue
        finally:
            os.close(found)
