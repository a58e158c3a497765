"""Bags of ROS 1 and ROS 2: a table for each topic, a column for each number, named by its path."""

from __future__ import annotations

from array import array
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from extensions.importers.readers.tables import FileTables, seconds_of
from flight_log.limits import bounded_reader
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

LOGGED = "logged"
"""The column with the time at which a message was written, s; `stamp` is its header's."""
MAX_ITEMS = 40
"""Largest number of an array's items that become columns."""


class BagTables(FileTables):
    """The topics `wanted` of a bag; stamps in s."""

    @classmethod
    def opened(cls, path: Path, wanted: Collection[str]) -> BagTables:
        """Read the bag, in bounded memory. Raises LogFormatError."""
        with bounded_reader(path.name):
            return cls(path, wanted)

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        """Read the bag. Raises LogFormatError."""
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        super().__init__(path)
        self._columns: dict[str, dict[str, array[float]]] = {}
        self._nanoseconds: dict[str, dict[str, array[float]]] = {}
        self._topics: list[str] = []
        try:
            with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as bag:
                self._topics = sorted(bag.topics)
                chosen = [one for one in bag.connections if one.topic in wanted]
                for one, logged_ns, data in (
                    bag.messages(chosen) if chosen else ()
                ):  # none means all
                    columns = self._columns.setdefault(one.topic, {})
                    message = bag.deserialize(data, one.msgtype)
                    times = {LOGGED: divmod(logged_ns, 1_000_000_000), **_stamp(message)}
                    for name, (seconds, nanoseconds) in times.items():
                        columns.setdefault(name, array("d")).append(seconds)
                        parts = self._nanoseconds.setdefault(one.topic, {})
                        parts.setdefault(name, array("d")).append(nanoseconds)
                    for name, value in _numbers(message):
                        columns.setdefault(name, array("d")).append(value)
        except MemoryError:
            raise  # named by the bound on it
        except KeyError as error:
            raise LogFormatError(
                f"{path.name} has messages of the type {error!s:.80}, which it does not describe"
            ) from error
        except Exception as error:  # of the reader, of compression, of a database
            why = str(error) or type(error).__name__
            files = sorted(one.name for one in path.glob("*.db3")) if path.is_dir() else []
            hint = f"; try {files[0]} in it alone" if files else ""
            raise LogFormatError(f"{path.name} is not a complete bag: {why:.120}{hint}") from error

    def tables(self) -> list[str]:
        return self._topics

    def columns(self, table: str) -> list[str]:
        found = self._columns.get(table, {})
        return [name for name, one in found.items() if len(one) == len(found[LOGGED])]

    def read(self, table: str, names: list[str]) -> Array:
        return np.stack([self._column(table, name)[0] for name in names], axis=1)

    def remainders(self, table: str, name: str) -> Array | None:
        return self._column(table, name)[1]

    def _column(self, table: str, name: str) -> tuple[Array, Array | None]:
        """Return a column, and by how much times are more than their float64."""
        values, parts = np.array(self._columns[table][name]), self._nanoseconds[table].get(name)
        return (values, None) if parts is None else seconds_of(values, np.array(parts))


def _stamp(message: object) -> dict[str, tuple[int, int]]:
    """Return the stamp of a message's header, s and ns, where it has one."""
    header = vars(message).get("header")
    return {} if header is None else {"stamp": (header.stamp.sec, header.stamp.nanosec)}


def _numbers(message: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Yield every number of a message with its path, but those of its header."""
    for name, value in vars(message).items():
        where = f"{path}.{name}" if path else name
        if where == "header":
            continue
        if isinstance(value, bool | int | float | np.number):
            yield where, float(value)
        elif isinstance(value, np.ndarray):
            for k, one in enumerate(value[:MAX_ITEMS].tolist()):
                yield f"{where}[{k}]", float(one)
        elif hasattr(value, "__dataclass_fields__"):
            yield from _numbers(value, where)
