"""MCAP files as ROS 2 writes them: a table for each topic, as those of bags."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode

from extensions.importers.readers.ros_bags import LOGGED
from extensions.importers.readers.tables import FileTables, seconds_of
from flight_log.format import UNREADABLE, parsed
from flight_log.payload_layout import HEADER_STAMP
from flight_log.records import WalkState, walk
from flight_log.topic_columns import ColumnReader, Columns
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

OWN = "quadlab"
"""The library that the head of a run's own log names."""


class McapTables(FileTables):
    """The topics `wanted` of an MCAP file, also of one without an index; stamps in s.

    Topics of other serialisations than ROS 2's are passed over.
    """

    @classmethod
    def opened(cls, path: Path, wanted: Collection[str]) -> McapTables:
        """Read the file, in bounded memory. Raises LogFormatError or StorageError."""
        return cls(path, wanted)

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        """Read the file. Raises LogFormatError or StorageError."""
        super().__init__(path)
        if library_of(path) == OWN:
            raise LogFormatError(
                f"{path.name} is a run of quadlab already: copy its folder to runs/ in the data "
                "folder, where the page shows it"
            )
        reader = ColumnReader(path, header_stamps=True)
        parts: dict[str, list[Columns]] = {}
        for batch in reader:
            for columns in batch.columns:
                kept = parts.setdefault(columns.topic, [])
                if columns.topic in wanted:
                    kept.append(columns)
        self.torn = f"it {reader.log.tear}" if reader.log.tear else ""
        self.unreadable = {
            topic: why for topic, why in reader.problems.items() if not parts.get(topic)
        }
        self.notes += [f"{topic}: {why}" for topic, why in reader.problems.items()]
        if lost := reader.log.damaged_chunks:
            self.notes.append(f"{path.name}: {lost} damaged chunks, whose messages are lost")
        self._remainders: dict[str, dict[str, Array]] = {}
        self._columns = {topic: self._joined(topic, found) for topic, found in parts.items()}

    def tables(self) -> list[str]:
        return sorted(self._columns)

    def columns(self, table: str) -> list[str]:
        return list(self._columns[table])

    def read(self, table: str, names: list[str]) -> Array:
        return np.stack([self._columns[table][name] for name in names], axis=1)

    def remainders(self, table: str, name: str) -> Array | None:
        return self._remainders[table].get(name)

    def _joined(self, topic: str, parts: list[Columns]) -> dict[str, Array]:
        """Return the columns of a topic's messages in the order of their reception, those of
        numbers that all of them have.
        """
        rest = self._remainders[topic] = {}
        if not parts:
            return {}
        shared = set(parts[0].numbers).intersection(*(one.numbers for one in parts))
        names = [name for name in parts[0].numbers if name in shared]
        logged = np.concatenate([one.log_ns for one in parts])
        order = np.argsort(logged, kind="stable")  # a file may have them in any order
        found = {name: np.concatenate([one.numbers[name] for one in parts]) for name in names}
        found = {name: values[order] for name, values in found.items()}
        seconds, nanoseconds = (found.pop(name, None) for name in HEADER_STAMP)
        if seconds is not None and nanoseconds is not None:
            found["stamp"], rest["stamp"] = seconds_of(seconds, nanoseconds)
        whole, part = np.divmod(logged[order], 1_000_000_000)
        found[LOGGED], rest[LOGGED] = seconds_of(whole.astype(float), part.astype(float))
        return found


def library_of(path: Path) -> str:
    """Return which library wrote an MCAP file, as its head says; empty without a sound head.

    Raises LogFormatError or StorageError.
    """
    opcode, data = next(walk(path, WalkState()), (0, b""))
    with suppress(*UNREADABLE):
        return str(parsed(opcode, data).library) if opcode == Opcode.HEADER else ""
    return ""
