"""Making messages: `new` fills fields that are not given with zeros, at every level of nesting."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from rosbags.interfaces import Nodetype

from quadrotor.errors import UsageError
from vehicle_link.messages.records import Header, Message, Time
from vehicle_link.messages.store import stored_name, typestore

if TYPE_CHECKING:
    from vehicle_link.messages.records import New

SECOND_NS = 1_000_000_000
_NOT_GIVEN: Any = object()
_BYTES = {"byte": "uint8", "char": "uint8"}  # both are octets on the wire


def _new_message(type_name: str, **fields: object) -> Message:
    return _new(stored_name(type_name), fields)


new = cast("New", _new_message)
"""Return a message with the given fields, all others zero, empty or false.

A nested message may be given as a message, a mapping of its fields, or a sequence of them in
order (`position=(1.0, 0.0, 0.5)`); arrays of numbers as any sequence. Raises TypeError where the
type has no such field, UsageError where there is no such type.
"""


def time_message(stamp_ns: int) -> Time:
    """Return builtin_interfaces/Time of integer nanoseconds."""
    seconds, rest = divmod(int(stamp_ns), SECOND_NS)
    return cast("Time", _class("builtin_interfaces/msg/Time")(sec=seconds, nanosec=rest))


def header(stamp_ns: int, frame_id: str = "world") -> Header:
    """Return std_msgs/Header of integer nanoseconds."""
    stamp = time_message(stamp_ns)
    return cast("Header", _class("std_msgs/msg/Header")(stamp=stamp, frame_id=frame_id))


def stamp_of(stamped: Message) -> int:
    """Return nanoseconds of a message with a header, of a header, or of a Time."""
    stamp: Any = getattr(stamped, "header", stamped)
    stamp = getattr(stamp, "stamp", stamp)
    return int(stamp.sec) * SECOND_NS + int(stamp.nanosec)


def _new(name: str, fields: Mapping[str, Any]) -> Message:
    store = typestore()
    if name not in store.types:
        raise UsageError(f"unknown message type {name!r}; see vehicle_link/messages for ours")
    entries = dict(store.fielddefs[name][1])
    if unknown := fields.keys() - entries.keys():
        raise TypeError(f"{name} has no field {', '.join(sorted(unknown))}; it has {list(entries)}")
    values = [_value(entry, fields.get(key, _NOT_GIVEN)) for key, entry in entries.items()]
    return _class(name)(*values)


def _class(name: str) -> Callable[..., Message]:
    return cast("Callable[..., Message]", typestore().types[name])


def _value(entry: Any, value: Any) -> Any:
    """Return `value`, or zero, as rosbags needs it for a field with this `fielddefs` entry."""
    kind, details = entry
    if kind == Nodetype.BASE:
        python = {"bool": bool, "string": str, "float32": float, "float64": float}
        convert = python.get(details[0], int)
        return convert() if value is _NOT_GIVEN else convert(value)
    if kind == Nodetype.NAME:
        return _nested(details, value)
    (item_kind, item), length = details
    count = length if kind == Nodetype.ARRAY else 0
    if item_kind == Nodetype.NAME:
        items = [_NOT_GIVEN] * count if value is _NOT_GIVEN else value
        return [_nested(item, one) for one in items]
    if item[0] == "string":
        return [""] * count if value is _NOT_GIVEN else [str(one) for one in value]
    dtype = np.dtype(_BYTES.get(item[0], item[0]))
    return np.zeros(count, dtype) if value is _NOT_GIVEN else np.asarray(value, dtype)


def _nested(name: str, value: Any) -> Message:
    if value is _NOT_GIVEN:
        return _new(name, {})
    if isinstance(value, Mapping):
        return _new(name, value)
    if hasattr(value, "__msgtype__"):
        return cast("Message", value)
    names = [key for key, _ in typestore().fielddefs[name][1]]
    return _new(name, dict(zip(names, value, strict=True)))
