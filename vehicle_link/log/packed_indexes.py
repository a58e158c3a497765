"""Index records of a file's chunks, kept packed until the file is closed.

The library keeps an object with a map for each chunk, 1.5 kB or more. A run has 25 to 50 chunks
a second, for little may be lost, so a station grew by 5 MB a minute. Packed they are 60 to 90 B.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Any

from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex

BLOCK = 1 << 15
FASTEST = 1  # of zlib's levels; 13 kB a second are packed


class PackedIndexes:
    """Stands where the library has its list of ChunkIndex: appended to, and gone through once."""

    def __init__(self) -> None:
        self._packed: list[bytes] = []
        self._open: Any = RecordBuilder()

    def append(self, index: ChunkIndex) -> None:
        index.write(self._open)
        if self._open.count > BLOCK:
            self._packed.append(zlib.compress(self._open.end(), FASTEST))

    def __iter__(self) -> Iterator[_Records]:
        """Each can `write` itself, as a ChunkIndex can."""
        for block in self._packed:
            yield _Records(zlib.decompress(block))
        rest = self._open.end()
        self._open.write(rest)
        yield _Records(rest)


class _Records:
    def __init__(self, data: bytes) -> None:
        self._data = data

    def write(self, stream: Any) -> None:
        stream.write(self._data)
