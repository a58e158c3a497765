"""Checks of the disk; each problem is a StorageError with advice."""

from __future__ import annotations

import os
import shutil
import stat
from contextlib import suppress
from pathlib import Path

from quadrotor.errors import StorageError

TRIED_BYTES = 1 << 20
"""Bytes written to test whether a disk accepts data: its free space does not show a quota."""


def free_bytes(folder: Path) -> int:
    """Return the free bytes on the disk of an existing folder. Raises StorageError."""
    try:
        return shutil.disk_usage(folder).free
    except OSError as error:
        raise StorageError(
            f"the folder {folder} cannot be reached ({error.strerror}); is its disk mounted?"
        ) from error


def recreate_folder(folder: Path) -> None:
    """Create a missing folder if its parent exists; otherwise its disk may not be mounted."""
    with suppress(OSError):  # reported at the next access
        folder.mkdir()


def folder_problem(folder: Path) -> tuple[str, str]:
    """Return what prevents files from being written into the folder, and what to do;
    else ("", "").
    """
    try:
        is_folder = stat.S_ISDIR(os.stat(folder).st_mode)
        is_read_only = bool(os.statvfs(folder).f_flag & os.ST_RDONLY)
    except FileNotFoundError:
        return f"the folder {folder} is missing", "mount its disk, or choose another with --data"
    except OSError as error:
        found = f"the folder {folder} cannot be reached ({error.strerror})"
        return found, "mount its disk and correct its permissions, or choose another with --data"
    if not is_folder:
        return f"{folder} is not a folder", "move that file away, or choose another with --data"
    if is_read_only:
        advice = "mount it writable (one with errors turns read-only: see dmesg), or choose another"
        return f"the disk of {folder} is read-only", f"{advice} with --data"
    if not os.access(folder, os.W_OK | os.X_OK):
        advice = "correct its permissions or choose another with --data"
        return f"the folder {folder} is not writable", advice
    return "", ""


def check_folder(folder: Path, keep_free: int) -> None:
    """Create the folder if needed. Raises StorageError when it is not writable or its disk is too
    full.
    """
    recreate_folder(folder)
    found, advice = folder_problem(folder)
    if found:
        raise StorageError(f"{found}; {advice}")
    if (free := free_bytes(folder)) < keep_free:
        raise StorageError(
            f"only {free // 10**6} MB are free in {folder}, {keep_free // 10**6} MB are kept; "
            "delete or move runs"
        )


def try_disk(folder: Path) -> None:
    """Write and sync a temporary file. Raises StorageError."""
    tried = folder / ".tried"
    try:
        with tried.open("wb") as file:
            file.write(bytes(TRIED_BYTES))
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise StorageError(f"cannot write into {folder}: {error.strerror}") from error
    finally:
        with suppress(OSError):
            tried.unlink()


def size_text(count: float) -> str:
    """Return a size as text, `500 MB`, `1.5 GB`; in gigabytes from one gigabyte on."""
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.0f} MB"
