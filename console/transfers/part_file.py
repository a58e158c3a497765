"""A file that comes in pieces: the pieces at their places, and a journal of which are there.

A piece is written before its line in the journal, and every line carries the piece's checksum. So
after an end at any byte, of the process or of the machine, what the journal tells and what has its
checksum is there; the rest is asked for again.
"""

from __future__ import annotations

import errno
import json
import os
import zlib
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from pathlib import Path

from console.transfers.vehicle_files import PIECE, VehicleFile
from quadrotor.errors import StorageError

Range = tuple[int, int]
"""Begin and end."""


class NoRoomError(StorageError):
    """The disk is full; it can go on when there is room again."""


class PartFile:
    """`<name>.part` and `<name>.part.journal` in a folder.

    Args:
        file: on board; what is there of another content under the same name is thrown away.

    Attributes:
        restarted: another content was there.
    """

    def __init__(self, folder: Path, file: VehicleFile) -> None:
        self.path = folder / f"{file.name}.part"
        self.journal = folder / f"{file.name}.part.journal"
        self.file = file
        self.restarted = False
        self._ranges: list[Range] = []
        try:
            folder.mkdir(exist_ok=True)  # no parents: its disk may be away
            self._data = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            self._lines = os.open(self.journal, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            self._resume()
        except OSError as error:
            raise _storage_error(self.path, error) from error

    @property
    def size(self) -> int:
        """Return the number of bytes received."""
        return sum(end - begin for begin, end in self._ranges)

    def lacks(self, begin: int, end: int) -> list[Range]:
        """Return what is missing of a range, in order."""
        found, place = [], begin
        for first, last in self._ranges:
            if last <= place:
                continue
            if first >= end:
                break
            if first > place:
                found.append((place, first))
            place = last
        if place < end:
            found.append((place, end))
        return found

    def pieces(self, ranges: Sequence[Range]) -> Iterator[tuple[int, int]]:
        """Yield offset and length of what is to be asked for."""
        for begin, end in ranges:
            for first, last in self.lacks(begin, end):
                for offset in range(first, last, PIECE):
                    yield offset, min(PIECE, last - offset)

    def put(self, offset: int, data: bytes) -> None:
        """Put a piece that came. Raises StorageError, NoRoomError when the disk is full."""
        try:
            _write(self._data, data, offset)
            self._append(f"{offset} {len(data)} {zlib.crc32(data):08x}\n")
        except OSError as error:
            raise _storage_error(self.path, error) from error
        self._add(offset, offset + len(data))

    def read(self, offset: int, length: int) -> bytes:
        return os.pread(self._data, length, offset)

    def sync(self) -> None:
        os.fdatasync(self._data)

    def close(self) -> None:
        for descriptor in (self._data, self._lines):
            if descriptor >= 0:
                os.close(descriptor)
        self._data = self._lines = -1

    def remove(self) -> None:
        self.close()
        self.path.unlink(missing_ok=True)
        self.journal.unlink(missing_ok=True)

    @staticmethod
    def discard(folder: Path, name: str) -> None:
        """Discard what came of a file that is no longer wanted."""
        for ending in ("part", "part.journal"):
            (folder / f"{name}.{ending}").unlink(missing_ok=True)

    def _resume(self) -> None:
        lines = Path(self.journal).read_bytes().splitlines(keepends=True)
        head = _head(lines[0]) if lines else {}
        if head.get("identity") != self.file.identity:
            self.restarted = bool(head.get("identity"))
            os.ftruncate(self._data, 0)
            os.ftruncate(self._lines, 0)
            head = {"identity": self.file.identity, "size": self.file.size}
            self._append(json.dumps(head) + "\n")
            return
        kept = len(lines[0])
        for line in lines[1:]:
            piece = _piece(line)
            if piece is None:
                break
            kept += len(line)
            offset, length, checksum = piece
            data = os.pread(self._data, length, offset)
            if len(data) == length and zlib.crc32(data) == checksum:
                self._add(offset, offset + length)
        os.ftruncate(self._lines, kept)  # a line cut off must not spoil the next one

    def _append(self, line: str) -> None:
        _write(self._lines, line.encode(), os.fstat(self._lines).st_size)

    def _add(self, begin: int, end: int) -> None:
        """Add a range and join what it touches."""
        first = bisect_left(self._ranges, (begin, begin))
        if first and self._ranges[first - 1][1] >= begin:
            first -= 1
        last = first
        while last < len(self._ranges) and self._ranges[last][0] <= end:
            begin, end = min(begin, self._ranges[last][0]), max(end, self._ranges[last][1])
            last += 1
        self._ranges[first:last] = [(begin, end)]


def want(folder: Path, name: str) -> None:
    """Remember a wanted file from now on, before anything of it is known. Raises StorageError."""
    journal = folder / f"{name}.part.journal"
    if journal.exists():
        return
    try:
        folder.mkdir(exist_ok=True)
        journal.write_text(json.dumps({"identity": 0}) + "\n")
    except OSError as error:
        raise _storage_error(journal, error) from error


def unwant(folder: Path, name: str) -> None:
    """Discard a wanted file of which nothing came yet."""
    if not (folder / f"{name}.part").exists():
        PartFile.discard(folder, name)


def wanted_downloads(folder: Path) -> list[str]:
    """Return the names of files whose fetching was cut off, the newest first. Raises OSError."""
    found = [(path.stat().st_mtime_ns, path.name) for path in folder.glob("*.part.journal")]
    return [name.removesuffix(".part.journal") for _, name in sorted(found, reverse=True)]


def _head(line: bytes) -> dict[str, int]:
    if not line.startswith(b"{") or not line.endswith(b"\n"):
        return {}
    try:
        return dict(json.loads(line))
    except ValueError:
        return {}


def _piece(line: bytes) -> tuple[int, int, int] | None:
    """Return offset, length and checksum; a head is an empty piece, None is no line of a
    journal.
    """
    if _head(line):
        return (0, 0, 0)
    try:
        offset, length, checksum = line.removesuffix(b"\n").split(b" ")
        piece = int(offset), int(length), int(checksum, 16)
    except ValueError:
        return None
    is_whole = line.endswith(b"\n") and len(checksum) == 8
    return piece if is_whole and piece[0] >= 0 and 0 < piece[1] <= PIECE else None


def _write(file: int, data: bytes, offset: int) -> None:
    left = memoryview(data)
    while left:
        written = os.pwrite(file, left, offset)
        left, offset = left[written:], offset + written


def _storage_error(path: Path, error: OSError) -> StorageError:
    kind = NoRoomError if error.errno in (errno.ENOSPC, errno.EDQUOT) else StorageError
    return kind(f"cannot write {path}: {error.strerror}")
