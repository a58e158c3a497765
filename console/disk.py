"""Questions to the disk, answered with a StorageError that says what to do."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from quadrotor.errors import StorageError


def free_bytes(folder: Path) -> int:
    """Free on the disk of an existing folder. Raises StorageError."""
    try:
        return shutil.disk_usage(folder).free
    except OSError as error:
        raise StorageError(
            f"the folder {folder} cannot be reached ({error.strerror}); is its disk mounted?"
        ) from error


def check_folder(folder: Path, keep_free: int) -> None:
    """Make it if needed; raises StorageError when it is not writable or its disk is too full."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(
            f"cannot make the folder {folder} ({error.strerror}); choose another with --data"
        ) from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise StorageError(
            f"the folder {folder} is not writable; mend its permissions or choose another "
            "with --data"
        )
    if (free := free_bytes(folder)) < keep_free:
        raise StorageError(
            f"only {free // 10**6} MB are free in {folder}, {keep_free // 10**6} MB are kept; "
            "delete or move runs"
        )
