"""Bags of ROS 1 and ROS 2: a table for each topic, a column for each number, named by its path."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Collection, Mapping
from contextlib import closing, suppress
from pathlib import Path
from sqlite3 import DatabaseError, connect
from typing import TYPE_CHECKING

import numpy as np
from mcap.records import Schema

from extensions.importers.readers.tables import FileTables, foreign_reader, narrow, seconds_of
from flight_log.payload_columns import PayloadColumns
from flight_log.payload_layout import HEADER_STAMP, ROS1, SchemaLayouts
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

LOGGED = "logged"
"""The column with the time at which a message was written, s; `stamp` is its header's."""
PIECE = 4096
"""Number of messages that are decoded at once."""
KIND = "SELECT type FROM sqlite_master WHERE name = 'messages'"
"""Asks for what holds the messages: a view may have rows without end."""


class BagTables(FileTables):
    """The topics `wanted` of a bag; stamps in s."""

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        """Read the bag. Raises LogFormatError."""
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        super().__init__(path)
        self._rows: dict[str, _Rows] = {}
        self._topics: list[str] = []
        self.torn = _unwritten(path)
        with (
            foreign_reader(path, "bag", lambda: _what_to_try(path)),
            AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as bag,
        ):
            self._topics = sorted(bag.topics)
            chosen = [one for one in bag.connections if one.topic in wanted]
            counts: Counter[tuple[str, str]] = Counter()
            for one in chosen:
                counts[one.topic, one.msgtype] += one.msgcount
            usual, notes = usual_types(counts, path.name)
            self.notes += notes
            chosen = [one for one in chosen if one.msgtype == usual[one.topic]]
            schemas = {one.msgtype: _described(bag, one.msgtype, path) for one in chosen}
            for one, logged_ns, data in bag.messages(chosen) if chosen else ():  # none means all
                if one.topic not in self._rows:
                    self._rows[one.topic] = _Rows(schemas[one.msgtype])
                self._rows[one.topic].add(bytes(data), logged_ns)
            for rows in self._rows.values():
                rows.decode()

    def tables(self) -> list[str]:
        return self._topics

    def columns(self, table: str) -> list[str]:
        return self._rows[table].names() if table in self._rows else []

    def read(self, table: str, names: list[str]) -> Array:
        return np.stack([self._rows[table].column(name)[0] for name in names], axis=1)

    def remainders(self, table: str, name: str) -> Array | None:
        return self._rows[table].column(name)[1]


def _databases(bag: Path) -> list[Path]:
    return sorted(bag.glob("*.db3")) if bag.is_dir() else []


def _unwritten(bag: Path) -> str:
    """Return which database of a bag its recorder has not written completely; empty if none."""
    for one in _databases(bag) or [bag]:
        for beside in (one.with_name(f"{one.name}-wal"), one.with_name(f"{one.name}-journal")):
            if beside.is_file() and beside.stat().st_size:
                return (
                    f"{beside.name} has what is not in {one.name} yet: stop the recorder, or let "
                    f"`sqlite3 {one.name} .tables` take it over"
                )
    return ""


def _what_to_try(bag: Path) -> str:
    """Return what to try with the databases of a bag; empty if it has none."""
    databases = _databases(bag)
    for one in databases:
        with (
            suppress(DatabaseError),
            closing(connect(f"{one.absolute().as_uri()}?mode=ro", uri=True)) as opened,
        ):
            if opened.execute(KIND).fetchone() == ("table",):
                for _ in opened.execute("SELECT data FROM messages"):
                    pass
                return f"; try {one.name} in it alone"
    return f"; sqlite3 {databases[0].name} .recover may save what it has" if databases else ""


def usual_types(
    counts: Mapping[tuple[str, str], int], name: str
) -> tuple[dict[str, str], list[str]]:
    """Return the type that most messages of each topic have, and a note on each with others.

    Args:
        counts: of messages by topic and type.
        name: of the file.
    """
    found: dict[str, str] = {}
    for (topic, kind), _ in sorted(counts.items(), key=lambda one: -one[1]):
        found.setdefault(topic, kind)
    return found, [
        f"{name}: {count} messages of {topic} are of {kind}, most of it of {found[topic]}: left out"
        for (topic, kind), count in counts.items()
        if kind != found[topic]
    ]


def _described(bag: AnyReader, kind: str, path: Path) -> Schema:
    """Return the description of a type. Raises LogFormatError where the bag has none."""
    if kind not in bag.typestore.fielddefs:
        raise LogFormatError(
            f"{path.name} has messages of the type {kind:.80}, which it does not describe"
        )
    text, _ = bag.typestore.generate_msgdef(kind, ros_version=2 if bag.is2 else 1)
    return Schema(0, text.encode(), "ros2msg" if bag.is2 else ROS1, kind)


class _Rows:
    """The numbers of one topic's messages, decoded some at a time; arrays that are not always as
    long are NaN where they are shorter.
    """

    def __init__(self, schema: Schema) -> None:
        """Raise LogFormatError where messages of this description cannot be read."""
        self._layouts, self._reader = SchemaLayouts(schema, stamps=True), PayloadColumns(schema)
        self._logged = array("q")
        self._held: list[bytes] = []
        self._paths: list[str] = []
        self._parts: list[dict[str, Array]] = []

    def add(self, payload: bytes, logged_ns: int) -> None:
        self._paths = self._paths or list(self._layouts.of(payload).numbers)
        self._logged.append(logged_ns)
        self._held.append(payload)
        if len(self._held) == PIECE:
            self.decode()

    def decode(self) -> None:
        """Decode the messages that are held."""
        found = self._reader.read(self._held, self._paths)
        none = np.broadcast_to(np.nan, len(self._held))
        self._parts.append({path: narrow(found.get(path, none)) for path in self._paths})
        self._held = []

    def names(self) -> list[str]:
        times = ["stamp", LOGGED] if HEADER_STAMP[0] in self._paths else [LOGGED]
        return [*times, *(one for one in self._paths if one not in HEADER_STAMP)]

    def column(self, name: str) -> tuple[Array, Array | None]:
        """Return a column, and by how much times are more than their float64."""
        if name == LOGGED:
            whole, part = np.divmod(np.frombuffer(self._logged, np.int64), 1_000_000_000)
            return seconds_of(whole.astype(np.float64), part.astype(np.float64))
        paths = HEADER_STAMP if name == "stamp" else (name,)
        found = [np.concatenate([one[path] for one in self._parts]) for path in paths]
        return seconds_of(*found) if name == "stamp" else (found[0], None)
