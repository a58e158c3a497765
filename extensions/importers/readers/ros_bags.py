"""Bags of ROS 1 and ROS 2: a table for each topic, a column for each number, named by its path."""

from __future__ import annotations

from array import array
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from extensions.importers.readers.tables import FileTables
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
        self._topics: list[str] = []
        try:
            with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as bag:
                self._topics = sorted(bag.topics)
                chosen = [one for one in bag.connections if one.topic in wanted]
                for one, logged_ns, data in bag.messages(chosen):
                    columns = self._columns.setdefault(one.topic, {})
                    message = bag.deserialize(data, one.msgtype)
                    for name, value in ((LOGGED, 1e-9 * logged_ns), *_numbers(message)):
                        columns.setdefault(name, array("d")).append(value)
        except MemoryError:
            raise  # named by the bound on it
        except KeyError as error:
            raise LogFormatError(
                f"{path.name} has messages of the type {error!s:.80}, which it does not describe"
            ) from error
        except Exception as error:  # of the reader, of compression, of a database
            why = str(error) or type(error).__name__
            raise LogFormatError(f"{path.name} is not a complete bag: {why:.120}") from error

    def tables(self) -> list[str]:
        return self._topics

    def columns(self, table: str) -> list[str]:
        found = self._columns.get(table, {})
        return [name for name, one in found.items() if len(one) == len(found[LOGGED])]

    def read(self, table: str, names: list[str]) -> Array:
        return np.stack([np.array(self._columns[table][name]) for name in names], axis=1)


def _numbers(message: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Yield every number of a message with its path; `stamp` is that of its header, s."""
    for name, value in vars(message).items():
        where = f"{path}.{name}" if path else name
        if where == "header":
            stamp = value.stamp
            yield "stamp", float(stamp.sec) + 1e-9 * float(stamp.nanosec)
        elif isinstance(value, bool | int | float | np.number):
            yield where, float(value)
        elif isinstance(value, np.ndarray):
            for k, one in enumerate(value[:MAX_ITEMS].tolist()):
                yield f"{where}[{k}]", float(one)
        elif hasattr(value, "__dataclass_fields__"):
            yield from _numbers(value, where)
