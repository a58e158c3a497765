"""Where in a closed log which time stands, from its index alone.

Only the wanted groups of the index are read, and its chunks are walked here: the mcap library takes
30 µs for each, and a flight of 20 minutes has 30 000. Beside a thread that must not wait the walk
gives the interpreter away again and again.
"""

from __future__ import annotations

import os
import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.writer import MCAP0_MAGIC

from flight_log.recovery import RECOVERED_METADATA
from quadrotor.errors import LogFormatError, StorageError

_RECORD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, summary, summary offsets, checksum
_OFFSET = struct.Struct("<BQBQQ")  # opcode, length, group, start, length of the group
_STATISTICS = struct.Struct("<QHIIIIQQ")
_CHUNK = struct.Struct("<QQQQI")  # first and last log time, place, length, length of a map
_NAME = struct.Struct("<QQI")  # place, length, length of the name
_END = _FOOTER.size + len(MCAP0_MAGIC)
_BREATH = 200
"""Chunks after which other threads may have the interpreter: 0.2 ms."""

_DAMAGES = (McapError, struct.error, LookupError, ValueError, OverflowError, StopIteration)

Numbers = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class FileIndex:
    """Times are those of reception (log time), ns; 0 without messages.

    Attributes:
        channels: id → topic and type.
        starts_ns, ends_ns: first and last message of each chunk, shape (N,).
        begins, ends: bytes of each chunk with its message indexes, shape (N,).
    """

    start_ns: int
    end_ns: int
    recovered: bool
    channels: dict[int, tuple[str, str]] = field(default_factory=dict)
    starts_ns: Numbers = field(default_factory=lambda: np.zeros(0, np.int64))
    ends_ns: Numbers = field(default_factory=lambda: np.zeros(0, np.int64))
    begins: Numbers = field(default_factory=lambda: np.zeros(0, np.int64))
    ends: Numbers = field(default_factory=lambda: np.zeros(0, np.int64))

    def stretch(self, start_ns: int, end_ns: int, late_ns: int) -> tuple[int, int]:
        """(begin, end) of whole chunks with all messages stamped between, both included.

        A message is received after its stamp: by `late_ns` at most, or with the first ones after
        a pause of its writer. (0, 0) when the file has no chunks.
        """
        if not len(self.begins):
            return 0, 0
        latest = np.maximum.accumulate(self.ends_ns)
        first = int(np.searchsorted(latest, start_ns))
        after_pause = min(int(np.searchsorted(latest, end_ns)), len(latest) - 1)
        bound = max(end_ns + late_ns, int(latest[after_pause]))
        last = int(np.flatnonzero(self.starts_ns <= bound)[-1])
        if first == len(latest):  # behind everything
            return int(self.ends[-1]), int(self.ends[-1])
        return int(self.begins[first]), int(self.ends[max(last, first)])


def holds_nothing(path: Path) -> bool:
    """Whether its writer was killed before the first record. Raises StorageError."""
    try:
        with path.open("rb") as stream:
            return MCAP0_MAGIC.startswith(stream.read(len(MCAP0_MAGIC) + 1))
    except OSError as error:
        raise StorageError(f"cannot read {path.name}: {error.strerror}") from error


def begins_as_log(file: int) -> bool:
    """Args: an open file's descriptor. Raises OSError."""
    return os.pread(file, len(MCAP0_MAGIC), 0) == MCAP0_MAGIC


def read_index(path: Path, *, chunks: bool = True) -> FileIndex:
    """Of a file with its index; without `chunks` and channels in a tenth of a millisecond.

    Raises LogFormatError when there is none, or StorageError.
    """
    try:
        with path.open("rb") as stream:
            return _read(stream.fileno(), chunks)
    except OSError as error:
        raise StorageError(f"cannot read {path.name}: {error.strerror}") from error
    except _DAMAGES as error:
        raise LogFormatError(f"{path.name} has no index that can be read") from error


def _read(file: int, chunks: bool) -> FileIndex:
    size = os.fstat(file).st_size
    tail = os.pread(file, _END, max(0, size - _END))
    opcode, _, summary, offsets, _ = _FOOTER.unpack_from(tail)
    if (
        opcode != Opcode.FOOTER
        or not tail.endswith(MCAP0_MAGIC)
        or not 0 < summary <= offsets <= size - _END
    ):
        raise ValueError("no footer")
    groups = {
        group: (start, length)
        for _, _, group, start, length in _OFFSET.iter_unpack(
            os.pread(file, size - _END - offsets, offsets)
        )
    }

    def content(opcode: Opcode) -> Iterator[bytes]:
        start, length = groups.get(opcode, (0, 0))
        if start + length > size:
            raise ValueError("index longer than its file")
        return _records(os.pread(file, length, start))

    statistics = _STATISTICS.unpack_from(next(content(Opcode.STATISTICS)))
    names = [_name(data) for data in content(Opcode.METADATA_INDEX)]
    times = statistics[6], statistics[7], RECOVERED_METADATA in names
    if not chunks:
        return FileIndex(*times)
    schemas = {one.id: one.name for one in map(_schema, content(Opcode.SCHEMA))}
    channels = {
        one.id: (one.topic, schemas[one.schema_id])
        for one in map(_channel, content(Opcode.CHANNEL))
    }
    return FileIndex(*times, channels, *_chunks(content(Opcode.CHUNK_INDEX)))


def _chunks(records: Iterator[bytes]) -> Iterator[Numbers]:
    rows = []
    for number, data in enumerate(records):
        start_ns, end_ns, begin, length, mapped = _CHUNK.unpack_from(data)
        indexes = int.from_bytes(data[_CHUNK.size + mapped : _CHUNK.size + mapped + 8], "little")
        rows.append((start_ns, end_ns, begin, begin + length + indexes))
        if number % _BREATH == 0:
            time.sleep(0.0)
    return iter(np.array(rows, np.int64).reshape(-1, 4).T.copy())


def _records(data: bytes) -> Iterator[bytes]:
    place = 0
    while place < len(data):
        _, length = _RECORD.unpack_from(data, place)
        place += _RECORD.size
        yield data[place : place + length]
        place += length


def _name(data: bytes) -> str:
    length = _NAME.unpack_from(data)[2]
    return data[_NAME.size : _NAME.size + length].decode()


def _schema(data: bytes) -> Any:
    return Schema.read(_stream(data))


def _channel(data: bytes) -> Any:
    return Channel.read(_stream(data))


def _stream(data: bytes) -> Any:
    return ReadDataStream(BytesIO(data))
