"""The offsets of a message's numbers and texts in its CDR or ROS 1 bytes, by the log's own schema.

`SchemaLayouts` walks one payload of a type by its definition and stores the offsets, together with
what they depend on: the lengths of its texts and sequences. Every payload with the same lengths
has the same layout, so that thousands are read at once.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from mcap.records import Schema
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.base import TypesysError

from quadrotor.errors import LogFormatError, UsageError
from vehicle_link.messages import stored_name, typestore

MAX_ITEMS = 64
"""Longest array whose items become signals; those of longer ones, like pictures, do not."""
MAX_MESSAGES = 1000
"""Largest number of messages in a sequence."""
MAX_PARTS = 20_000
"""Limit of messages and texts in one payload, as an empty type may occur any number of times."""
MAX_NUMBERS = 4000
"""Largest number of one payload's numbers that become signals."""
MAX_TEXT = 1_000_000
"""Largest size of one text, and of a sequence's texts together, in bytes."""
HEADERS = frozenset({"header", "stamp"})
"""Fields that are not signals: times are handled separately."""
HEADER_STAMP = ("header.stamp.sec", "header.stamp.nanosec")
"""Numbers of a header, read on demand."""
SERVICE_EVENT = """service_msgs/ServiceEventInfo info
{name}_Request[<=1] request
{name}_Response[<=1] response
{cut}
MSG: service_msgs/ServiceEventInfo
uint8 event_type
builtin_interfaces/Time stamp
char[16] client_gid
int64 sequence_number
{cut}
MSG: {name}_Request
{request}
{cut}
MSG: {name}_Response
{response}
"""
"""The message of a service's event, of which a log describes the service alone."""
ROS1 = "rosbag1"  # encoding of schemas of ROS 1's bags: no head, and nothing is aligned
Types = Mapping[str, Any]
_LENGTH = struct.Struct("<I")
_OCTETS = {"byte": "uint8", "char": "uint8", "bool": "uint8", "octet": "uint8"}


@dataclass
class PayloadLayout:
    """The layout of a payload; offsets count from its first byte, including CDR's 4-byte header."""

    size: int
    lengths: list[tuple[int, int]] = field(default_factory=list)  # offset of a uint32, its value
    numbers: dict[str, tuple[int, np.dtype]] = field(default_factory=dict)  # by path
    texts: dict[str, list[tuple[int, int]]] = field(default_factory=dict)  # offset, bytes

    @cached_property
    def record(self) -> np.dtype[np.void]:
        """Return the payload as a numpy type whose fields are its numbers."""
        return np.dtype(
            {
                "names": list(self.numbers),
                "formats": [kind for _, kind in self.numbers.values()],
                "offsets": [offset for offset, _ in self.numbers.values()],
                "itemsize": self.size,
            }
        )

    def fits(self, rows: npt.NDArray[np.uint8]) -> npt.NDArray[np.bool_]:
        """Return which of the payloads (N, size) have this layout, shape (N,)."""
        same = np.ones(len(rows), bool)
        for offset, value in self.lengths:
            same &= np.ascontiguousarray(rows[:, offset : offset + 4]).view("<u4")[:, 0] == value
        return same


class SchemaLayouts:
    """Layouts of one schema.

    Args:
        stamps: whether HEADER_STAMP is read too.

    Raises LogFormatError when the schema is of an unsupported kind.
    """

    def __init__(self, schema: Schema, *, stamps: bool = False) -> None:
        self._stamps = HEADER_STAMP if stamps else ()
        self._head = 0 if schema.encoding == ROS1 else 4  # bytes before a message
        if schema.encoding not in ("ros2msg", ROS1):
            raise LogFormatError(
                f"{schema.name} is described in {schema.encoding!r}; only ros2msg is read"
            )
        try:
            self._name = stored_name(schema.name)
            self._found = get_types_from_msg(_definition(schema), self._name)
        except UsageError as error:
            raise LogFormatError(
                f"{schema.name!r:.80} is not the name of a ROS 2 type; read are package/msg/Name "
                "and package/Name"
            ) from error
        except (TypesysError, UnicodeDecodeError, ValueError) as error:
            raise LogFormatError(f"the description of {schema.name} cannot be read") from error
        self._types: Types = {**typestore().fielddefs, **self._found}
        try:
            self._check(self._name, set())
        except KeyError as error:
            raise LogFormatError(
                f"{schema.name} is made of {error!s:.80}, which the log does not describe"
            ) from error
        except RecursionError as error:
            raise LogFormatError(f"{schema.name} is made of itself; no message can be") from error

    @property
    def foreign(self) -> list[str]:
        """Return the message types in it whose fields differ from ours of the same name."""
        ours = typestore().fielddefs
        return [
            name
            for name, (_, fields) in self._found.items()
            if name in ours and list(fields) != list(ours[name][1])
        ]

    def _check(self, name: str, sound: set[str]) -> None:
        """Raise KeyError where a message contains a type that is not described, RecursionError
        where it contains itself; `sound` has the types that were checked, and gets this one.
        """
        for _, (kind, details) in self._types[name][1]:
            inner = details[0] if kind == Nodetype.ARRAY else (kind, details)
            if inner[0] == Nodetype.NAME and inner[1] not in sound:
                self._check(str(inner[1]), sound)
        sound.add(name)

    def of(self, payload: bytes) -> PayloadLayout:
        """Return the layout of a payload. Raises LogFormatError when the payload does not fit its
        type.
        """
        if self._head and (len(payload) < self._head or payload[1] != 1):
            raise LogFormatError(f"{self._name}: only little-endian CDR is read")
        walk = _Walk(payload, self._head, self._types, self._stamps)
        try:
            walk.message(self._name, "", shown=True)
        except (struct.error, KeyError, RecursionError) as error:
            raise LogFormatError(f"{len(payload)} bytes are not a {self._name}") from error
        return walk.layout


def _definition(schema: Schema) -> str:
    """Return the description of a message. Raises UnicodeDecodeError."""
    text = schema.data.decode()
    request, cut, response = text.partition("\n---\n")
    if not (cut or text.startswith("---\n")) or not schema.name.endswith("_Event"):
        return text
    if not cut:
        request, response = "", text.removeprefix("---\n")
    package, *_, name = schema.name.removesuffix("_Event").split("/")
    return SERVICE_EVENT.format(
        name=f"{package}/{name}", request=request, response=response, cut="=" * 80
    )


class _Walk:
    def __init__(self, payload: bytes, head: int, types: Types, stamps: tuple[str, ...]) -> None:
        self._payload, self._types, self._stamps = payload, types, stamps
        self._at = self._head = head
        self._parts = 0
        self.layout = PayloadLayout(len(payload))

    def message(self, name: str, prefix: str, *, shown: bool) -> None:
        self._count_part()
        fields = self._types[name][1]
        if not fields and self._head:
            self._at += 1  # ROS 2 gives a message without members one of a byte
        for key, (kind, details) in fields:
            path = f"{prefix}{key}"
            wanted = shown and key not in HEADERS
            if kind == Nodetype.BASE:
                self._base(str(details[0]), path, shown=wanted)
            elif kind == Nodetype.NAME:
                self.message(str(details), f"{path}.", shown=wanted)
            else:
                self._array(path, details, is_sequence=kind == Nodetype.SEQUENCE, shown=wanted)
        if self._at > len(self._payload):
            raise LogFormatError(f"{len(self._payload)} bytes are not a {name}: too few")

    def _count_part(self) -> None:
        self._parts += 1
        if self._parts > MAX_PARTS:
            raise LogFormatError(
                f"it has more than {MAX_PARTS} messages and texts in one; so many are not read"
            )

    def _base(self, primitive: str, path: str, *, shown: bool) -> None:
        if primitive in ("string", "wstring"):
            self._keep_texts(path, [self._text()], shown=shown)
            return
        self._numbers(primitive, [path] if shown or path in self._stamps else [], 1)

    def _array(self, path: str, details: Any, *, is_sequence: bool, shown: bool) -> None:
        (kind, item), count = details
        if is_sequence:
            count = self._length()
        if kind == Nodetype.NAME:
            if count > MAX_MESSAGES:
                raise LogFormatError(f"{path} has {count} items; at most {MAX_MESSAGES} are read")
            for k in range(count):
                self.message(str(item), f"{path}[{k}].", shown=shown and k < MAX_ITEMS)
        elif item[0] in ("string", "wstring"):
            self._keep_texts(path, [self._text() for _ in range(count)], shown=shown)
        else:
            listed = shown and count <= MAX_ITEMS and len(self.layout.numbers) < MAX_NUMBERS
            self._numbers(str(item[0]), [f"{path}[{k}]" for k in range(count * listed)], count)

    def _numbers(self, primitive: str, paths: list[str], count: int) -> None:
        dtype = np.dtype(_OCTETS.get(primitive, primitive)).newbyteorder("<")
        if count:
            self._align(dtype.itemsize)
        for k, path in enumerate(paths[: MAX_NUMBERS - len(self.layout.numbers)]):
            self.layout.numbers[path] = (self._at + k * dtype.itemsize, dtype)
        self._at += count * dtype.itemsize

    def _keep_texts(self, path: str, pieces: list[tuple[int, int]], *, shown: bool) -> None:
        size = sum(length for _, length in pieces)
        if shown and size > MAX_TEXT:
            raise LogFormatError(
                f"{path} has {size / 1e6:.0f} MB of text; at most {MAX_TEXT // 10**6} MB are read"
            )
        if shown:
            self.layout.texts[path] = pieces

    def _text(self) -> tuple[int, int]:
        self._count_part()
        length, offset = self._length(), self._at  # behind the length
        self._at += length
        if self._at > len(self._payload):
            raise LogFormatError(f"{len(self._payload)} bytes are too few for its texts")
        return offset, max(length - 1, 0) if self._head else length  # without CDR's closing zero

    def _length(self) -> int:
        self._align(4)
        value: int = _LENGTH.unpack_from(self._payload, self._at)[0]
        self.layout.lengths.append((self._at, value))
        self._at += 4
        return value

    def _align(self, size: int) -> None:
        """Align the offset, counted from after CDR's header."""
        self._at += -(self._at - self._head) % size if self._head else 0
