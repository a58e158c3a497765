"""How many messages a closed log has, from its last bytes alone: for a log that lies elsewhere."""

from __future__ import annotations

import struct
from collections.abc import Callable

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from quadrotor.errors import LogFormatError

END_BYTES = 37
"""Of the footer and the end mark."""
_RECORD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI")
_OFFSET = struct.Struct("<BQQ")
_COUNTS = struct.Struct("<QHIIIIQQI")  # messages, …, first and last log time, bytes of the map
_COUNT = struct.Struct("<HQ")
LONGEST = 100_000

Read = Callable[[int, int], bytes]
"""Place and length → as many bytes."""


def channel_counts(read: Read, size: int) -> dict[int, int]:
    """Channel id → number of its messages, by the index of a closed log of `size` bytes.

    Three short pieces are read. Raises LogFormatError when there is no such index, and what `read`
    raises.
    """
    try:
        opcode, _, begin, offsets, _ = _FOOTER.unpack(_end(read, size))
        if opcode != Opcode.FOOTER or not 0 < begin <= offsets < size:
            raise ValueError("no summary")
        place, length = _statistics(read(offsets, size - END_BYTES - offsets))
        if not begin <= place < offsets or not 0 < length <= LONGEST:
            raise ValueError("no statistics")
        return _counts(read(place, length))
    except (ValueError, struct.error) as error:
        raise LogFormatError(f"the log has no index that can be read ({error})") from error


def _end(read: Read, size: int) -> bytes:
    data = read(size - END_BYTES, END_BYTES)
    if not data.endswith(MCAP0_MAGIC):
        raise ValueError("no end mark")
    return data[: _FOOTER.size]


def _statistics(offsets: bytes) -> tuple[int, int]:
    """Where they stand: place and length."""
    place = 0
    while place < len(offsets):
        opcode, length = _RECORD.unpack_from(offsets, place)
        place += _RECORD.size
        if opcode == Opcode.SUMMARY_OFFSET:
            group, begin, size = _OFFSET.unpack_from(offsets, place)
            if group == Opcode.STATISTICS:
                return begin, size
        place += length
    raise ValueError("no statistics")


def _counts(record: bytes) -> dict[int, int]:
    opcode, _ = _RECORD.unpack_from(record)
    if opcode != Opcode.STATISTICS:
        raise ValueError("no statistics")
    *_, length = _COUNTS.unpack_from(record, _RECORD.size)
    begin = _RECORD.size + _COUNTS.size
    return dict(_COUNT.iter_unpack(record[begin : begin + length]))
