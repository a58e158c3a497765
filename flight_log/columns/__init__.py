"""A log read once: its topics as columns, out of Arrow files that are made at the first reading.

They belong to the log's file, its size and its time of change: when it grows or is mended, they are
made again, and so are damaged ones. They lie in the folder `.columns` beside the runs where there
is one, else in the user's cache folder; where neither can be written, they last as long as their
reader.
"""

from __future__ import annotations

import json
import mmap
import os
import shutil
import tempfile
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import platformdirs
import xxhash
from mcap.records import Schema

from flight_log.columns.writer import (
    HEADER,
    INDEX,
    PAYLOAD,
    RECEIVED,
    STAMP,
    VERSION,
    digest,
    write_columns,
)
from flight_log.payload_layout import HEADER_STAMP
from flight_log.reader import decodable_name
from flight_log.run_folder import log_of
from quadrotor.errors import StorageError

CACHES = ".columns"
"""Folder of the runs' columns, beside the runs."""
LARGEST = 4_000_000_000
"""Bytes of all columns in a cache folder; those looked at longest ago go first."""
ON_ITS_WAY = ".new"
MEMORY = Path("/dev/shm")
"""Folder in which columns are made when no disk has room."""

NOTHING: dict[str, Any] = {"type": "", "count": 0, "numbers": [], "constants": {}, "texts": {}}

Floats = npt.NDArray[np.floating[Any]]
Stamps = npt.NDArray[np.int64]


class Topic:
    """N messages of one topic, in the order they were written; read when asked for.

    Args:
        facts: of the topic, as `log.json` has them; none for a topic without messages.
        table: gives its Arrow table and the map that it lies in.
        dtype: of the numbers.

    Attributes:
        texts: of each the places (index, text) where it changes.
    """

    def __init__(
        self,
        facts: Mapping[str, Any] | None = None,
        table: Callable[[], tuple[Any, mmap.mmap]] | None = None,
        dtype: npt.DTypeLike = np.float32,
        schema: tuple[str, str] | None = None,
    ) -> None:
        self._facts = facts or NOTHING
        self._open, self._schema, self.dtype = table, schema, np.dtype(dtype)
        self.names: list[str] = self._facts["numbers"]
        self.constants: dict[str, float] = self._facts["constants"]
        self.texts: dict[str, list[tuple[int, str]]] = self._facts["texts"]
        self._known = frozenset(self.names)

    def __len__(self) -> int:
        return int(self._facts["count"])

    def __contains__(self, name: str) -> bool:
        return name in self._known or (name in HEADER_STAMP and self._facts["has_header"])

    @property
    def type_name(self) -> str:
        return str(self._facts["type"])

    @cached_property
    def decodable_name(self) -> str:
        """Return the type by which the payloads are decoded."""
        if self._schema is None:
            return self.type_name
        name, described = self._schema
        return decodable_name(Schema(0, described.encode(), "ros2msg", name))

    @cached_property
    def _mapped(self) -> tuple[Any, mmap.mmap]:
        assert self._open is not None
        return self._open()

    @property
    def arrow(self) -> Any:
        """Return its columns as they lie in the file, a pyarrow.Table."""
        return self._mapped[0]

    def _column(self, name: str, first: int = 0, last: int | None = None) -> npt.NDArray[Any]:
        column = self.arrow[name].slice(first, None if last is None else last - first)
        if column.num_chunks == 1:
            lying: npt.NDArray[Any] = column.chunk(0).to_numpy()
            return lying
        # By numpy, which gives the memory back when it is done with; Arrow's pool keeps it.
        copied: npt.NDArray[Any] = np.concatenate([one.to_numpy() for one in column.chunks])
        self.release()
        return copied

    @property
    def log_ns(self) -> Stamps:
        """Return the stamps of reception at the writer, (N,)."""
        return self._column(RECEIVED) if len(self) else np.zeros(0, np.int64)

    @property
    def publish_ns(self) -> Stamps:
        """Return the stamps of the source, (N,)."""
        return self._column(STAMP) if len(self) else np.zeros(0, np.int64)

    @property
    def header_ns(self) -> Stamps:
        """Return the stamps in the messages' headers, (N,), of a type that has them."""
        delay = self._facts.get("header_delay_ns")
        if not len(self) or delay == 0:
            return self.publish_ns
        found: Stamps = self.publish_ns + (self._column(HEADER) if delay is None else delay)
        return found

    @property
    def payloads(self) -> list[bytes]:
        """Return the messages of a topic that is kept whole."""
        if not len(self) or PAYLOAD not in self.arrow.column_names:
            return []
        found: list[bytes] = self.arrow[PAYLOAD].to_pylist()
        return found

    def values(self, name: str, first: int = 0, last: int | None = None) -> Floats:
        """Return a number of the messages from `first` to before `last`, (N,), NaN where there is
        none; not to be written into.
        """
        if name in HEADER_STAMP and name in self:
            seconds, rest = np.divmod(self.header_ns[first:last], 1_000_000_000)
            return (seconds if name == HEADER_STAMP[0] else rest).astype(self.dtype)
        if name not in self._known or name in self.constants:
            value = np.array(self.constants.get(name, np.nan), self.dtype)
            return np.broadcast_to(value, len(self))[first:last]
        found = self._column(name, first, last)
        if self.dtype == found.dtype:
            return found
        with np.errstate(over="ignore", invalid="ignore"):
            made = found.astype(self.dtype)
        self.release()
        return made

    def release(self) -> None:
        """Let the kernel take the pages back that were read: they count as this process's."""
        if len(self):
            self._mapped[1].madvise(mmap.MADV_DONTNEED)

    def take(self, names: Collection[str]) -> Floats:
        """Return (N, len(names)), NaN for a number the topic does not have."""
        out = np.empty((len(self), len(names)), self.dtype)
        for k, name in enumerate(names):
            out[:, k] = self.values(name)
        self.release()
        return out


@dataclass
class LogColumns:
    """The columns of a log.

    Attributes:
        topics: by full name, in the order of their first messages.
        attachments, metadata: of the log, by name.
        tear: why reading stopped early; empty: at the log's end.
        damaged_chunks, damaged_records: how many were passed over.
        problems: by topic, why it could not be read.
        folder: where they lie.
        identity: of the log that they were made of.
        note: why the columns are not kept; empty when they are.
    """

    path: Path
    folder: Path
    identity: list[int]
    topics: dict[str, Topic]
    attachments: dict[str, bytes]
    metadata: dict[str, dict[str, str]]
    tear: str
    damaged_chunks: int
    damaged_records: int
    problems: dict[str, str]
    note: str = ""


class _DamagedError(Exception):
    """Columns are not what was written, or not of this log."""


class _Folder:
    """The columns of a log in their folder; without `tell` none are made."""

    def __init__(self, log: Path, place: Path, tell: Callable[[float], None] | None) -> None:
        self.log, self._tell = log, tell
        self._identity = identity(log) if tell else []
        self.note = ""
        self._temporary: tempfile.TemporaryDirectory[str] | None = None
        self.folder = place
        try:
            self.index = self._read(place)
            with suppress(OSError):
                os.utime(place / INDEX)
        except (OSError, _DamagedError):
            self._make(place)

    def _read(self, folder: Path) -> dict[str, Any]:
        head, _, data = (folder / INDEX).read_bytes().partition(b"\n")
        if xxhash.xxh3_64_hexdigest(data).encode() != head:
            raise _DamagedError
        index: dict[str, Any] = json.loads(data)
        if index["version"] != VERSION or self._identity not in ([], index["identity"]):
            raise _DamagedError
        return index

    def _make(self, place: Path) -> None:
        """Make the columns in `place`, or where there is room for them."""
        if self._tell is None:
            raise StorageError(f"the columns of {self.log.name} are not there, or damaged")
        try:
            self._write(place, self._tell)
            make_room(place.parent, place.name)
            return
        except OSError as error:
            problems = [f"{place.parent}: {error.strerror or error}"]
        for parent in (None, MEMORY):
            try:
                own = tempfile.TemporaryDirectory(prefix="quadlab-columns-", dir=parent)
                self._write(Path(own.name) / "columns", self._tell)
                self._temporary = own
                self.note = f"the columns of {self.log.name} are not kept ({problems[0]})"
                return
            except OSError as error:
                problems.append(error.strerror or str(error))
        raise StorageError(f"no room for the columns of {self.log.name}: {'; '.join(problems)}")

    def _write(self, place: Path, tell: Callable[[float], None]) -> None:
        new = place.with_name(f"{place.name}.{os.getpid()}{ON_ITS_WAY}")
        shutil.rmtree(new, ignore_errors=True)
        try:
            write_columns(self.log, new, self._identity, tell)
            shutil.rmtree(place, ignore_errors=True)
            with suppress(OSError):  # another process was faster: its columns are as good
                new.rename(place)
            self.index, self.folder = self._read(place), place
        except _DamagedError as error:
            raise OSError(f"{place} is changed by another process") from error
        finally:
            shutil.rmtree(new, ignore_errors=True)

    def table(self, topic: str) -> tuple[Any, mmap.mmap]:
        """Return a topic's table and its map; damaged columns are made again. Raises StorageError,
        LogFormatError.
        """
        try:
            return self._mapped(topic)
        except (OSError, _DamagedError):
            self._make(self.folder)
        try:
            return self._mapped(topic)
        except (OSError, _DamagedError) as error:
            raise StorageError(f"the columns of {self.log.name} cannot be kept: {error}") from error

    def _mapped(self, topic: str) -> tuple[Any, mmap.mmap]:
        import pyarrow as pa

        facts = self.index["topics"][topic]
        path = self.folder / facts["file"]
        if path.stat().st_size != facts["bytes"] or digest(path) != facts["digest"]:
            raise _DamagedError
        with path.open("rb") as file:
            mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        return pa.ipc.open_file(pa.BufferReader(pa.py_buffer(mapped))).read_all(), mapped


def read_columns(
    log: Path,
    tell: Callable[[float], None] = lambda share: None,
    dtype: npt.DTypeLike = np.float32,
    place: Path | None = None,
) -> LogColumns:
    """Return the columns of a log, made first where there are none.

    Args:
        tell: called with the share that is made, 0 to 1.
        dtype: of the numbers.
        place: folder of the columns, default `place_of(log)`.

    Raises LogFormatError or StorageError.
    """
    log = log_of(log)
    return _columns(_Folder(log, place or place_of(log), tell), dtype)


def kept_columns(log: Path, dtype: npt.DTypeLike = np.float32) -> LogColumns:
    """Return the columns that are kept of a log, also of an earlier state of it. Raises
    StorageError when there are none.
    """
    log = log_of(log)
    return _columns(_Folder(log, place_of(log), None), dtype)


def _columns(folder: _Folder, dtype: npt.DTypeLike) -> LogColumns:
    index = folder.index
    topics = {
        name: Topic(facts, _opener(folder, name), dtype, index["schemas"].get(name))
        for name, facts in index["topics"].items()
    }
    attachments = {name: text.encode("latin-1") for name, text in index["attachments"].items()}
    names = ("identity", "metadata", "tear", "damaged_chunks", "damaged_records", "problems")
    facts: dict[str, Any] = {name: index[name] for name in names}
    return LogColumns(
        path=folder.log,
        folder=folder.folder,
        topics=topics,
        attachments=attachments,
        note=folder.note,
        **facts,
    )


def _opener(folder: _Folder, name: str) -> Callable[[], tuple[Any, mmap.mmap]]:
    return lambda: folder.table(name)


def read_topics(
    log: Path, vehicle: str, wanted: Collection[str], dtype: npt.DTypeLike = np.float32
) -> dict[str, Topic]:
    """Return topics of one vehicle, by name without namespace; one without messages is empty.

    Raises LogFormatError or StorageError.
    """
    found = read_columns(log, dtype=dtype).topics
    return {name: found.get(f"/{vehicle}/{name}") or Topic(dtype=dtype) for name in wanted}


def identity(log: Path) -> list[int]:
    """Return what tells a log from one that was changed. Raises StorageError."""
    try:
        status = log.stat()
    except OSError as error:
        raise StorageError(f"cannot read {log}: {error.strerror}") from error
    return [status.st_size, status.st_mtime_ns]


def place_of(log: Path) -> Path:
    """Return the folder of a log's columns; `log` is the file."""
    log = log.resolve()
    run = log.parent if (log.parent.parent / CACHES).is_dir() else log
    if (run.parent / CACHES).is_dir():
        return run.parent / CACHES / run.stem
    name = f"{log.stem[:60]}-{xxhash.xxh3_64_hexdigest(str(log).encode())}"
    return Path(platformdirs.user_cache_dir("quadlab", appauthor=False)) / "columns" / name


def make_room(folder: Path, name: str) -> bool:
    """Remove from a cache folder what killed processes have left, the columns of removed runs and,
    above LARGEST, those looked at longest ago, but not those called `name`, finished or on their
    way; return whether that was enough.
    """
    others = []
    for one in folder.glob("*"):
        if one.suffix == ON_ITS_WAY and not _is_alive(one):
            shutil.rmtree(one, ignore_errors=True)
        elif one.name != name and one.suffix != ON_ITS_WAY:
            others.append((_looked_at(one), one))
    excess = folder_bytes(folder) - LARGEST
    for looked_at, one in sorted(others):
        if looked_at and excess <= 0:
            break
        excess -= folder_bytes(one)
        shutil.rmtree(one, ignore_errors=True)
    return excess <= 0


def _is_alive(columns: Path) -> bool:
    """Return whether the process that makes these columns runs."""
    return Path("/proc", columns.stem.rpartition(".")[2]).exists()


def _looked_at(columns: Path) -> float:
    """Return when somebody last did, s; 0 for columns that are damaged or whose run is gone."""
    runs = columns.parent.parent
    run = runs / columns.name
    if columns.parent.name == CACHES and not (
        run.exists() or run.with_name(f"{run.name}.mcap").exists()
    ):
        return 0.0
    with suppress(OSError):
        return (columns / INDEX).stat().st_mtime
    return 0.0


def folder_bytes(folder: Path) -> int:
    """Return the bytes of all files below, as far as they can be seen: others may be removing
    them.
    """
    total = 0
    for root, _, names in os.walk(folder):
        for name in names:
            with suppress(OSError):
                total += os.lstat(os.path.join(root, name)).st_size
    return total
