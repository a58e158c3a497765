"""Index records of a file's chunks, kept beside the file until it is closed.

The library keeps an object with a map for each chunk, 1.5 kB or more. A run has 25 to 50 chunks
a second, for little may be lost, so a station grew by 5 MB a minute.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex

from flight_log.aside import Aside

BLOCK = 1 << 15


class ChunkIndexes:
    """Stands where the library has its list of ChunkIndex: appended to, and gone through."""

    def __init__(self, aside: Aside) -> None:
        self._aside = aside
        self._open: Any = RecordBuilder()

    def append(self, index: ChunkIndex) -> None:
        """Raises StorageError when the disk refuses."""
        index.write(self._open)
        if self._open.count > BLOCK:
            self._aside.put(self._open.end())

    def __iter__(self) -> Iterator[_Records]:
        """Each can `write` itself, as a ChunkIndex can. Raises StorageError."""
        for piece in self._aside:
            yield _Records(piece)
        rest = self._open.end()
        self._open.write(rest)
        yield _Records(rest)


class _Records:
    def __init__(self, data: bytes) -> None:
        self._data = data

    def write(self, stream: Any) -> None:
        stream.write(self._data)
