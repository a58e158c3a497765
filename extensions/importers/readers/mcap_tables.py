"""MCAP files as ROS 2 writes them: a table for each topic, as those of bags."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode

from extensions.importers.readers.progress import tell
from extensions.importers.readers.ros_bags import LOGGED, usual_types
from extensions.importers.readers.tables import FileTables, narrow, seconds_of
from flight_log.format import UNREADABLE, parsed
from flight_log.payload_layout import HEADER_STAMP
from flight_log.records import WalkState, walk
from flight_log.topic_columns import ColumnReader, Columns
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

OWN = "quadlab"
"""The library that the head of a run's own log names."""
MOST_VALUES = 25_000_000
"""Largest number of values of the topics that are read, 200 MB: an hour of an IMU at 500 Hz."""


class McapTables(FileTables):
    """The topics `wanted` of an MCAP file, also of one without an index; stamps in s.

    Topics of other serialisations than ROS 2's are passed over.
    """

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
        wanted, values = set(wanted), 0
        for batch in reader:
            tell(batch.share)
            for columns in batch.columns:
                kept = parts.setdefault(columns.topic, [])
                columns.type_name = columns.type_name.replace("/msg/", "/")  # both are written
                if columns.topic in wanted:
                    columns.numbers = {k: narrow(one) for k, one in columns.numbers.items()}
                    values += sum(len(one) for one in columns.numbers.values() if one.strides[0])
                    kept.append(columns)
            if values > MOST_VALUES:
                raise LogFormatError(
                    f"{path.name} has more than {MOST_VALUES} different values in "
                    f"{', '.join(sorted(wanted & parts.keys()))}: cut it into flights"
                )
        self.torn = f"it {reader.log.tear}" if reader.log.tear else ""
        self.unreadable = {
            topic: why for topic, why in reader.problems.items() if not parts.get(topic)
        }
        self.notes += [f"{topic}: {why}" for topic, why in reader.problems.items()]
        if lost := reader.log.damaged_chunks:
            self.notes.append(f"{path.name}: {lost} damaged chunks, whose messages are lost")
        counts: Counter[tuple[str, str]] = Counter()
        for topic, kept in parts.items():
            for one in kept:
                counts[topic, one.type_name] += len(one.log_ns)
        usual, notes = usual_types(counts, path.name)
        self.notes += notes
        self._parts = {
            topic: [one for one in kept if one.type_name == usual[topic]]
            for topic, kept in parts.items()
        }

    def tables(self) -> list[str]:
        return sorted(self._parts)

    def columns(self, table: str) -> list[str]:
        """Return the numbers that all messages have, and their times."""
        parts = self._parts[table]
        if not parts:
            return []
        shared = set(parts[0].numbers).intersection(*(one.numbers for one in parts))
        names = [one for one in parts[0].numbers if one in shared and one not in HEADER_STAMP]
        return [*names, *(["stamp"] if shared.issuperset(HEADER_STAMP) else []), LOGGED]

    def read(self, table: str, names: list[str]) -> Array:
        return np.stack([self._column(table, name)[0] for name in names], axis=1)

    def remainders(self, table: str, name: str) -> Array | None:
        return self._column(table, name)[1]

    def _column(self, table: str, name: str) -> tuple[Array, Array | None]:
        """Return a column in the order of reception, and by how much times are more than their
        float64.
        """
        parts = self._parts[table]
        logged = np.concatenate([one.log_ns for one in parts])
        order = np.argsort(logged, kind="stable")  # a file may have them in any order
        if name == LOGGED:
            whole, part = np.divmod(logged[order], 1_000_000_000)
            return seconds_of(whole.astype(float), part.astype(float))
        names = HEADER_STAMP if name == "stamp" else (name,)
        found = [np.concatenate([one.numbers[k] for one in parts])[order] for k in names]
        return seconds_of(*found) if name == "stamp" else (found[0], None)


def library_of(path: Path) -> str:
    """Return which library wrote an MCAP file, as its head says; empty without a sound head.

    Raises LogFormatError or StorageError.
    """
    opcode, data = next(walk(path, WalkState()), (0, b""))
    with suppress(*UNREADABLE):
        return str(parsed(opcode, data).library) if opcode == Opcode.HEADER else ""
    return ""
