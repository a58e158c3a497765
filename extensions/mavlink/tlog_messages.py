"""Messages of MAVLink of one kind, decoded together from the bytes of a file."""

from __future__ import annotations

import re
import struct
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from quadrotor.records import Array

HEAD_1, HEAD_2 = 6, 10
"""Bytes before the payload of both versions."""
ARRIVAL, CHECKSUM = 8, 2
"""Bytes of the time before each packet, and of the checksum behind its payload."""
LOGGED = "logged"
"""The column of arrival, s."""
TIMES = {"time_boot_ms": 1000.0, "time_usec": 1.0}
"""Columns of the vehicle's clock, and their factors to us."""
COUNTER = 2.0**32
AT_WRAP = 1e7
"""Largest step over the end of a counter, us; after a restart the clock is elsewhere."""
ALL = slice(None)
Bytes = npt.NDArray[np.uint8]
Places = npt.NDArray[np.int64]


class Kind(NamedTuple):
    """A kind of messages, of which the numbers are decoded, without arrays and texts."""

    name: str
    size: int  # of its payload
    checksum: int  # that of its description
    fields: dict[str, tuple[int, np.dtype[Any]]]  # offset and type of the fields that are numbers
    instance: str | None  # which of them tells instances apart
    time: str | None  # which of them is the vehicle's clock

    @classmethod
    def of(cls, described: Any) -> Kind:
        """Return the decoding of a kind that pymavlink describes."""
        items, offset = [], 0
        for count, code in re.findall(r"(\d*)([a-zA-Z])", described.unpacker.format):
            for one in [count + code] if code == "s" else [code] * int(count or 1):
                items.append((offset, one))
                offset += struct.calcsize(f"<{one}")
        fields = {}
        for name, order in zip(described.fieldnames, described.orders, strict=True):
            place, code = items[sum(described.lengths[:order])]
            if described.lengths[order] == 1 and code[-1] not in "sc":
                fields[name] = (place, np.dtype(f"<{code}"))
        instance = described.instance_field
        return cls(
            str(described.msgname),
            size=offset,
            checksum=described.crc_extra,
            fields=fields,
            instance=instance if instance in fields else None,
            time=next((one for one in TIMES if one in fields), None),
        )

    def payloads(self, packets: Bytes) -> tuple[npt.NDArray[np.bool_], Bytes]:
        """Return which packets (N, size) of one version and size have a right checksum, and the
        payloads of these, (M, size).
        """
        begin = HEAD_1 if packets[0, 0] == 0xFE else HEAD_2
        end = begin + int(packets[0, 1])
        crc = np.full(len(packets), 0xFFFF, np.uint16)  # X.25's
        for byte in (*packets[:, 1:end].T, np.uint8(self.checksum)):
            low = (byte ^ crc) & 0xFF
            low ^= (low << 4) & 0xFF
            crc = (crc >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4)
        right = (crc & 0xFF == packets[:, end]) & (crc >> 8 == packets[:, end + 1])
        found = np.zeros((int(right.sum()), self.size), np.uint8)
        sent = min(end - begin, self.size)  # zeros at the end of a packet are not sent
        found[:, :sent] = packets[right, begin : begin + sent]
        return right, found


class Messages(NamedTuple):
    """The messages of one kind, in the order in which they arrived."""

    kind: Kind
    arrival: Places  # (N,) us
    numbers: Places  # (N,), of their packets in the file
    payloads: Bytes  # (N, size)

    def column(self, name: str, rows: Places | slice = ALL) -> Array:
        """Return the numbers of a field, or the times of arrival, s; those of the vehicle's clock
        go on where a counter of 32 bits began anew.
        """
        if name == LOGGED:
            return self.arrival[rows].astype(np.float64) * 1e-6
        place, kind = self.kind.fields[name]
        column = np.ascontiguousarray(self.payloads[rows, place : place + kind.itemsize])
        found: Array = column.view(kind)[:, 0].astype(np.float64)
        if name == self.kind.time and len(found):
            steps = np.diff(found, prepend=found[0])
            is_wrap = np.abs(np.abs(steps) - COUNTER) < AT_WRAP / TIMES[name]
            found -= COUNTER * np.cumsum(np.sign(steps) * is_wrap)
        return found

    def chosen(self, rows: npt.NDArray[Any]) -> Messages:
        """Return some of the messages, or all in another order."""
        return Messages(self.kind, *(one[rows] for one in self[1:]))


def decoded(
    kind: Kind, octets: Bytes, records: Places, chosen: Places, heads: npt.NDArray[np.uint16]
) -> Messages:
    """Return the messages of a kind with a right checksum.

    Args:
        octets: the file.
        records: where its records begin.
        chosen: those of this kind.
        heads: the first two bytes of each packet, which tell its size.
    """
    parts = []
    for one in np.unique(heads[chosen]).tolist():
        alike = chosen[heads[chosen] == one]
        size = ARRIVAL + (HEAD_1 if one >> 8 == 0xFE else HEAD_2) + one % 256 + CHECKSUM
        rows = np.lib.stride_tricks.sliding_window_view(octets, size)[records[alike]]
        right, payloads = kind.payloads(rows[:, ARRIVAL:])
        arrival = rows[right, :ARRIVAL].view(">u8")[:, 0].astype(np.int64)
        parts.append((arrival, alike[right], payloads))
    found = Messages(kind, *map(np.concatenate, zip(*parts, strict=True)))
    return found.chosen(np.argsort(found.numbers)) if len(parts) > 1 else found
