"""A partly received file: its bytes from the first on, and the identity of its content.

After an interruption at any byte, of the process or of the machine, the rest is requested; at the
end the checksum of the whole file shows whether every byte is the vehicle's.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Iterator
from pathlib import Path

from console.transfers.vehicle_files import PIECE, VehicleFile
from quadrotor.errors import StorageError

ENDING = ".part.journal"


class NoRoomError(StorageError):
    """The disk is full; the transfer can continue when there is room again."""


class PartFile:
    """`<name>.part` in a folder, and `<name>.part.journal`, which identifies its content.

    Args:
        file: on board; an existing part of another content under the same name is discarded.

    Attributes:
        size: bytes received.
        restarted: whether another content was discarded.
    """

    def __init__(self, folder: Path, file: VehicleFile) -> None:
        self.path, self.journal = _places(folder, file.name)
        self.file = file
        try:
            folder.mkdir(exist_ok=True)  # without parents: its disk may not be mounted
            before = _identity(self.journal)
            self.restarted = before not in (0, file.identity)
            if before != file.identity:
                self.path.write_bytes(b"")
                self.journal.write_text(json.dumps({"identity": file.identity}) + "\n")
            self._data = self.path.open("ab", buffering=0)
        except OSError as error:
            raise _storage_error(self.path, error) from error
        self.size = self._data.tell()

    def pieces(self) -> Iterator[tuple[int, int]]:
        """Yield offset and length of the pieces that are still to be requested."""
        for offset in range(self.size, self.file.size, PIECE):
            yield offset, min(PIECE, self.file.size - offset)

    def put(self, data: bytes) -> None:
        """Append the next piece. Raises StorageError, NoRoomError when the disk is full."""
        left = memoryview(data)
        try:
            while left:
                written = os.write(self._data.fileno(), left)
                self.size += written
                left = left[written:]
        except OSError as error:
            raise _storage_error(self.path, error) from error

    def sync(self) -> None:
        os.fdatasync(self._data.fileno())

    def close(self) -> None:
        self._data.close()


def discard(folder: Path, name: str) -> None:
    """Remove the part of a file that is no longer needed, or has its own name by now."""
    for path in _places(folder, name):
        path.unlink(missing_ok=True)


def request_download(folder: Path, name: str) -> None:
    """Remember a file to be fetched, before anything about it is known. Raises StorageError."""
    _, journal = _places(folder, name)
    if journal.exists():
        return
    try:
        folder.mkdir(exist_ok=True)
        journal.write_text(json.dumps({"identity": 0}) + "\n")
    except OSError as error:
        raise _storage_error(journal, error) from error


def withdraw_download(folder: Path, name: str) -> None:
    """Forget a file to be fetched of which no byte has arrived yet."""
    data, journal = _places(folder, name)
    if not data.exists():
        journal.unlink(missing_ok=True)


def requested_downloads(folder: Path) -> list[str]:
    """Return the names of files whose transfer was interrupted, newest first. Raises OSError."""
    found = [(path.stat().st_mtime_ns, path.name) for path in folder.glob(f"*{ENDING}")]
    return [name.removesuffix(ENDING) for _, name in sorted(found, reverse=True)]


def _places(folder: Path, name: str) -> tuple[Path, Path]:
    return folder / f"{name}.part", folder / f"{name}{ENDING}"


def _identity(journal: Path) -> int:
    """Return the identity that a journal names, 0 for none. Raises OSError."""
    try:
        return int(json.loads(journal.read_bytes().partition(b"\n")[0])["identity"])
    except (FileNotFoundError, ValueError, LookupError, TypeError):
        return 0


def _storage_error(path: Path, error: OSError) -> StorageError:
    kind = NoRoomError if error.errno in (errno.ENOSPC, errno.EDQUOT) else StorageError
    return kind(f"cannot write {path}: {error.strerror}")
