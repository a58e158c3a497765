"""The numbers in a message type: the path of each, and how to read it from a message."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from rosbags.interfaces import Nodetype

from vehicle_link.messages.construct import Message
from vehicle_link.messages.names import stored_name
from vehicle_link.messages.store import typestore

Path = tuple[str | int, ...]

TIMES = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
"""Types that are not values but say when values were valid."""


class Number(NamedTuple):
    """One number (or boolean) of a message."""

    path: Path  # ("pose", "pose", "position", "x"); array members by index
    fields: tuple[tuple[str, str], ...]  # message type and field, from the outermost in


def numbers(type_name: str, members: int) -> list[Number]:
    """Return the numbers of a message of this type, in its order, without its times.

    Args:
        members: number of members of an array without a fixed length.
    """
    return list(_walk(stored_name(type_name), members, (), ()))


def number_at(message: Message, path: Path) -> float:
    """Return the number at a path; NaN where an array is too short."""
    value: Any = message
    for step in path:
        if not isinstance(step, int):
            value = getattr(value, step)
        elif step < len(value):
            value = value[step]
        else:
            return math.nan
    return float(value)


def _walk(
    type_name: str, members: int, path: Path, fields: tuple[tuple[str, str], ...]
) -> Iterator[Number]:
    fielddefs: Any = typestore().fielddefs[type_name][1]
    for name, (kind, details) in fielddefs:
        place, chain = (*path, name), (*fields, (type_name, name))
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            (item_kind, item), length = details
            for i in range(length if kind == Nodetype.ARRAY else members):
                yield from _one(item_kind, item, members, (*place, i), chain)
        else:
            yield from _one(kind, details, members, place, chain)


def _one(
    kind: Any, details: Any, members: int, path: Path, fields: tuple[tuple[str, str], ...]
) -> Iterator[Number]:
    if kind == Nodetype.NAME:
        if details not in TIMES:
            yield from _walk(details, members, path, fields)
    elif details[0] not in ("string", "wstring"):
        yield Number(path, fields)
