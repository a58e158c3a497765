"""The file of a log: nothing waits in user memory, so a killed process loses no complete chunk."""

from __future__ import annotations

import fcntl
import os
import stat
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from flight_log.run_folder import log_of, station_log
from quadrotor.errors import StorageError, os_errors

PIECE = 1 << 15
"""Bytes held in memory before the data set aside go to a file, and read from it at once."""
READING = os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK


class LogFile:
    """An unbuffered file that is exclusively locked while it is open.

    The lock shows `recover` in another process that this log is still being written.
    """

    def __init__(self, path: Path, *, replace: bool = False) -> None:
        """Raise StorageError when the file exists (unless `replace`) or cannot be made."""
        self.path = path
        self.size = 0
        # Without a name: it disappears with its process, however that ends.
        self._stored = tempfile.SpooledTemporaryFile(PIECE, "w+b", dir=str(path.parent))  # noqa: SIM115
        self._fd = -1
        self._closing = threading.Lock()  # prevents closing during a sync
        flags = os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | (0 if replace else os.O_EXCL)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._fd = os.open(path, flags, 0o644)
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not self.is_in_place():  # its previous writer has moved it in the meantime
                raise BlockingIOError
            os.ftruncate(self._fd, 0)
        except BlockingIOError:
            self.close()
            raise StorageError(f"{path} is being written by another process") from None
        except OSError as error:
            self.close()
            if isinstance(error, FileExistsError) and path.parent.is_dir():
                raise StorageError(f"{path} exists already; logs are never overwritten") from None
            raise StorageError(
                f"cannot make {path}: {error.strerror}; check the folder and its permissions"
            ) from error

    def write(self, data: bytes) -> int:
        """Write all of `data`, or raise StorageError."""
        left = memoryview(data)
        try:
            while left:
                written = os.write(self._fd, left)
                self.size += written
                left = left[written:]
        except OSError as error:
            raise StorageError(
                f"cannot write {self.path}: {error.strerror} after {self.size} bytes; "
                "what was written so far stays readable"
            ) from error
        return len(data)

    def store_for_end(self, data: bytes) -> None:
        """Store data for the end of the file, without holding it in memory. Raises StorageError."""
        try:
            self._stored.write(data)
        except OSError as error:
            raise self._index_error(error) from error

    def stored(self) -> Iterator[bytes]:
        """Yield all data stored by `store_for_end`, in pieces. Raises StorageError."""
        try:
            self._stored.seek(0)
            while piece := self._stored.read(PIECE):
                yield piece
        except OSError as error:
            raise self._index_error(error) from error

    def _index_error(self, error: OSError) -> StorageError:
        return StorageError(
            f"cannot write an index to {self.path.parent}: {error.strerror or error}; "
            "what was written so far stays readable"
        )

    def sync(self) -> None:
        """Flush to the disk (0.4 ms for 64 kB); thread-safe. Raises StorageError."""
        with self._closing, os_errors(lambda why: f"cannot write {self.path}: {why}"):
            if self._fd >= 0:
                os.fdatasync(self._fd)

    def is_in_place(self) -> bool:
        """Return False if the file or its folder was removed, so that further writes are lost."""
        try:
            return os.path.samestat(os.fstat(self._fd), os.stat(self.path))
        except OSError:
            return False

    def close(self) -> None:
        """Close the file. Raises StorageError when the disk reports a failed write only now."""
        with suppress(OSError):
            self._stored.close()
        with self._closing:
            descriptor, self._fd = self._fd, -1
        if descriptor >= 0:
            with os_errors(lambda why: f"cannot write {self.path}: {why}"):
                os.close(descriptor)


@contextmanager
def open_log(path: Path) -> Iterator[BinaryIO]:
    """Yield a log opened for reading; in a run's folder, the one that `log_of` chooses.

    Raises StorageError, also for an OSError while it is open, and when it is not a regular file: a
    pipe would block for ever.
    """
    path = log_of(path)
    with os_errors(lambda why: f"cannot read {path}: {why}"):
        descriptor = os.open(path, READING)
        mode = os.fstat(descriptor).st_mode
        if not stat.S_ISREG(mode):
            os.close(descriptor)
            what = "a folder" if stat.S_ISDIR(mode) else "no file but a pipe or a device"
            raise StorageError(f"cannot read {path}: it is {what}; give the path of an .mcap file")
        with os.fdopen(descriptor, "rb") as stream:
            yield stream


def is_being_written(path: Path) -> bool:
    """Return True while a LogFile has this path open, in any process of this machine; for a run's
    folder, while its station's log is open.

    Raises OSError.
    """
    descriptor = os.open(station_log(path), READING)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False


def sync_folder(folder: Path) -> None:
    """Flush a folder to the disk, so that a new name in it survives a power cut. Raises OSError."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
