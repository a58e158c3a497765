"""Bags of ROS 1 and ROS 2: a table for each topic, a column for each number, named by its path."""

from __future__ import annotations

from array import array
from collections.abc import Collection, Iterator
from operator import attrgetter
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
        self._rows: dict[str, _Rows] = {}
        self._topics: list[str] = []
        try:
            with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as bag:
                self._topics = sorted(bag.topics)
                chosen = [one for one in bag.connections if one.topic in wanted]
                for one, logged_ns, data in (
                    bag.messages(chosen) if chosen else ()
                ):  # none means all
                    message = bag.deserialize(data, one.msgtype)
                    if one.topic not in self._rows:
                        self._rows[one.topic] = _Rows(message)
                    self._rows[one.topic].add(message, logged_ns)
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
        return self._rows[table].names() if table in self._rows else []

    def read(self, table: str, names: list[str]) -> Array:
        return np.stack([self._rows[table].column(name)[0] for name in names], axis=1)

    def remainders(self, table: str, name: str) -> Array | None:
        return self._rows[table].column(name)[1]


class _Rows:
    """The numbers of one topic's messages; arrays that are not always as long are left out."""

    def __init__(self, first: object) -> None:
        """Note where the numbers of messages like the first one are."""
        self._times = {LOGGED: array("q"), **({"stamp": array("q")} if _has_stamp(first) else {})}
        found = dict(_values(first))
        self._lists = {
            path: (attrgetter(path), len(one), array("d"))
            for path, one in found.items()
            if isinstance(one, np.ndarray)
        }
        self._paths = [path for path in found if path not in self._lists]
        self._numbers_of = attrgetter(*self._paths) if self._paths else None
        self._numbers = array("d")

    def add(self, message: Any, logged_ns: int) -> None:
        self._times[LOGGED].append(logged_ns)
        if "stamp" in self._times:
            stamp = message.header.stamp
            self._times["stamp"].append(stamp.sec * 1_000_000_000 + stamp.nanosec)
        if self._numbers_of:
            found = self._numbers_of(message)
            self._numbers.extend(found if len(self._paths) > 1 else (found,))
        for path, (get, length, items) in list(self._lists.items()):
            if len(found := get(message)) == length:
                items.extend(found[:MAX_ITEMS].tolist())
            else:
                del self._lists[path]

    def names(self) -> list[str]:
        items = [
            f"{path}[{k}]" for path, (_, n, _) in self._lists.items() for k in range(n)[:MAX_ITEMS]
        ]
        return [*self._times, *self._paths, *items]

    def column(self, name: str) -> tuple[Array, Array | None]:
        """Return a column, and by how much times are more than their float64."""
        if name in self._times:
            whole, part = np.divmod(np.frombuffer(self._times[name], np.int64), 1_000_000_000)
            return seconds_of(whole.astype(np.float64), part.astype(np.float64))
        rows = len(self._times[LOGGED])
        if name in self._paths:
            return np.frombuffer(self._numbers).reshape(rows, -1)[:, self._paths.index(name)], None
        path, _, place = name.rpartition("[")
        return np.frombuffer(self._lists[path][2]).reshape(rows, -1)[:, int(place[:-1])], None


def _has_stamp(message: object) -> bool:
    return hasattr(getattr(message, "header", None), "stamp")


def _values(message: Any, path: str = "") -> Iterator[tuple[str, object]]:
    """Yield every number of a message, and every array of numbers, with its path, but those of its
    header.
    """
    for name, value in vars(message).items():
        where = f"{path}.{name}" if path else name
        if where == "header":
            continue
        if isinstance(value, bool | int | float | np.number | np.ndarray):
            yield where, value
        elif hasattr(value, "__dataclass_fields__"):
            yield from _values(value, where)
