"""Messages of fixed size as numpy records, so that thousands are encoded in one copy.

A ROS message whose texts and sequence lengths never change has every field at a fixed place.
`FixedLayout` finds those places by walking the message's definition with CDR's alignment (a
primitive of n bytes starts at a multiple of n, counted from the end of the 4-byte header) and
offers them as a numpy structured type: filling N messages is one assignment per field.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.interfaces import Nodetype

from quadrotor.errors import LinkError
from vehicle_link.messages import stored_name, typestore

CDR_HEADER = b"\x00\x01\x00\x00"  # little endian, no options

Records = npt.NDArray[np.void]


class FixedLayout:
    """The byte layout of one message type whose texts and sequence lengths are fixed.

    Fields of the dtype are named by their path (`header.stamp.sec`). A nested message whose
    fields are all of one numeric type becomes one field with an axis: a Vector3 is
    `position`, shape (N, 3), a Quaternion `orientation`, shape (N, 4), ROS order (x, y, z, w).
    The messages of a sequence are numbered: `transforms.0.child_frame_id`.

    Args:
        type_name: for instance `nav_msgs/Odometry`.
        strings: text of each string field, by path; those not named are empty.
        lengths: number of items of each sequence, by path; those not named have none.

    Raises:
        ValueError: a path in `strings` or `lengths` is no such field of the message.
    """

    def __init__(
        self,
        type_name: str,
        strings: Mapping[str, str] | None = None,
        lengths: Mapping[str, int] | None = None,
    ) -> None:
        self.type_name = type_name
        self._strings = dict(strings or {})
        self._lengths = dict(lengths or {})
        self._end = 0
        self._fields: list[tuple[str, Any, int]] = []  # name, numpy format, offset
        self._constants: list[tuple[int, bytes]] = [(0, CDR_HEADER)]
        self._walk(stored_name(type_name), "")
        if left := self._strings.keys() | self._lengths.keys():
            raise ValueError(f"{type_name} has no such string or sequence: {sorted(left)}")
        self.size = len(CDR_HEADER) + self._end
        names, formats, offsets = zip(*self._fields, strict=True)
        self.dtype = np.dtype(
            {"names": names, "formats": formats, "offsets": offsets, "itemsize": self.size}
        )
        template = bytearray(self.size)
        for offset, constant in self._constants:
            template[offset : offset + len(constant)] = constant
        self._template = template

    def new(self, count: int = 1) -> Records:
        """Return `count` messages with constants in place and all else zero, shape (count,)."""
        return np.frombuffer(self._template * count, self.dtype)

    def fits(self, payload: bytes) -> bool:
        """Return whether the payload has exactly these texts and lengths, hence this layout."""
        return len(payload) == self.size and all(
            payload.startswith(constant, offset) for offset, constant in self._constants
        )

    def decode(self, payload: bytes) -> np.void:
        """Return one record, read in place.

        Raises:
            LinkError: texts or lengths differ from this layout's (decode it with `messages`).
        """
        record: np.void = self.decode_many([payload])[0]
        return record

    def decode_many(self, payloads: list[bytes]) -> Records:
        """Decode N payloads to records, shape (N,). Raises LinkError as `decode` does."""
        for payload in payloads:
            if not self.fits(payload):
                raise LinkError(
                    f"{len(payload)} bytes do not have the layout of {self.type_name} "
                    f"({self.size} bytes); do both ends run the same version of quadlab?"
                )
        return np.frombuffer(b"".join(payloads), self.dtype)

    def _walk(self, name: str, prefix: str) -> None:
        for field, (kind, details) in typestore().fielddefs[name][1]:
            path = f"{prefix}{field}"
            if kind == Nodetype.BASE:
                self._base(path, str(details[0]))
            elif kind == Nodetype.NAME:
                self._nested(path, str(details))
            else:
                self._array(path, details, is_sequence=kind == Nodetype.SEQUENCE)

    def _base(self, path: str, primitive: str) -> None:
        if primitive != "string":
            self._place(path, _dtype(primitive), ())
            return
        text = self._strings.pop(path, "").encode() + b"\x00"
        self._constant(len(text).to_bytes(4, "little") + text)

    def _nested(self, path: str, name: str) -> None:
        primitives = set(_primitives(name))
        if len(primitives) == 1 and "" not in primitives:
            self._place(path, _dtype(primitives.pop()), (len(list(_primitives(name))),))
        else:
            self._walk(name, f"{path}.")

    def _array(self, path: str, details: Any, *, is_sequence: bool) -> None:
        (kind, item), length = details
        count = length
        if is_sequence:
            count = self._lengths.pop(path, 0)
            self._constant(count.to_bytes(4, "little"))
        if count == 0:
            return
        if kind == Nodetype.BASE and item[0] != "string":
            self._place(path, _dtype(item[0]), (count,))
            return
        primitives = list(_primitives(str(item))) if kind == Nodetype.NAME else [""]
        if kind == Nodetype.NAME and (len(set(primitives)) != 1 or "" in primitives):
            for number in range(count):
                self._walk(str(item), f"{path}.{number}.")
            return
        if "" in primitives:
            raise ValueError(f"{self.type_name}.{path}: texts of an array have no fixed place")
        self._place(path, _dtype(primitives[0]), (count, len(primitives)))

    def _place(self, path: str, dtype: np.dtype, shape: tuple[int, ...]) -> None:
        self._align(dtype.itemsize)
        self._fields.append((path, (dtype, shape), len(CDR_HEADER) + self._end))
        self._end += dtype.itemsize * int(np.prod(shape))

    def _constant(self, data: bytes) -> None:
        self._align(4)  # every constant starts with a uint32 length
        self._constants.append((len(CDR_HEADER) + self._end, data))
        self._end += len(data)

    def _align(self, size: int) -> None:
        self._end += -self._end % size


def payloads_of(records: Records) -> list[bytes]:
    """Return the bytes of each record, in order."""
    data, size = records.tobytes(), records.dtype.itemsize
    return [data[start : start + size] for start in range(0, len(data), size)]


def _primitives(name: str) -> Iterator[str]:
    """Yield the primitive of each field of a message; "" where a field is not a plain number."""
    for _, (kind, details) in typestore().fielddefs[name][1]:
        plain = kind == Nodetype.BASE and details[0] != "string"
        yield str(details[0]) if plain else ""


def _dtype(primitive: str) -> np.dtype:
    octets = {"byte": "uint8", "char": "uint8", "bool": "bool"}
    return np.dtype(octets.get(primitive, primitive)).newbyteorder("<")
