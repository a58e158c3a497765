"""A log's topics as columns, from Arrow files that are made at the first reading.

They belong to the log's file, its size and its modification time: when it grows or is repaired,
they are made again, as damaged ones are. They are stored in the folder `.columns` next to the runs
if there is one, else in the user's cache folder; if neither is writable, they last as long as
their reader.
"""

from __future__ import annotations

import json
import mmap
import os
import shutil
import tempfile
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xxhash

from flight_log.columns.places import UNFINISHED, identity, make_room, place_of
from flight_log.columns.topic import Topic
from flight_log.columns.writer import INDEX, VERSION, digest, reader_digest, write_columns
from flight_log.run_folder import log_of
from quadrotor.errors import StorageError

MEMORY = Path("/dev/shm")
"""Folder in which columns are made when no disk has room."""


@dataclass
class LogColumns:
    """The columns of a log.

    Attributes:
        topics: by full name, in the order of their first messages.
        attachments, metadata: of the log, by name.
            tear: why reading stopped early; empty if it reached the log's end.
            damaged_chunks, damaged_records: how many were skipped.
            problems: by topic, why it could not be read.
            folder: where the columns are stored.
            identity: of the log from which they were made.
            note: why the columns are not stored permanently; empty when they are.
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
    """The columns differ from what was written, belong to another log, or lack what is read now."""


class _Folder:
    """The columns of a log in their folder; without `progress` none are made."""

    def __init__(self, log: Path, place: Path, progress: Callable[[float], None] | None) -> None:
        self.log, self._progress = log, progress
        self._identity = identity(log) if progress else []
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
        if self._progress and index["problems"] and index.get("reader") != reader_digest():
            raise _DamagedError  # what could not be read then may be read now
        return index

    def _make(self, place: Path) -> None:
        """Make the columns in `place`, or where there is room for them."""
        if self._progress is None:
            raise StorageError(f"the columns of {self.log.name} are missing or damaged")
        try:
            self._write(place, self._progress)
            make_room(place.parent, place.name)
            return
        except OSError as error:
            problems = [f"{place.parent}: {error.strerror or error}"]
        for parent in (None, MEMORY):
            try:
                own = tempfile.TemporaryDirectory(prefix="quadlab-columns-", dir=parent)
                self._write(Path(own.name) / "columns", self._progress)
                self._temporary = own
                self.note = f"the columns of {self.log.name} are not kept ({problems[0]})"
                return
            except OSError as error:
                problems.append(error.strerror or str(error))
        raise StorageError(f"no room for the columns of {self.log.name}: {'; '.join(problems)}")

    def _write(self, place: Path, progress: Callable[[float], None]) -> None:
        new = place.with_name(f"{place.name}.{os.getpid()}{UNFINISHED}")
        shutil.rmtree(new, ignore_errors=True)
        try:
            write_columns(self.log, new, self._identity, progress)
            shutil.rmtree(place, ignore_errors=True)
            with suppress(OSError):  # another process was faster; its columns are equivalent
                new.rename(place)
            self.index, self.folder = self._read(place), place
        except _DamagedError as error:
            raise OSError(f"{place} is changed by another process") from error
        finally:
            shutil.rmtree(new, ignore_errors=True)

    def table(self, topic: str) -> tuple[Any, mmap.mmap]:
        """Return a topic's table and its map; damaged columns are made again. Raises StorageError
        or LogFormatError.
        """
        try:
            return self._mapped(topic)
        except (OSError, _DamagedError):
            self._make(self.folder)
        try:
            return self._mapped(topic)
        except (OSError, _DamagedError) as error:
            raise StorageError(
                f"the columns of {self.log.name} cannot be stored: {error}"
            ) from error

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
    progress: Callable[[float], None] = lambda share: None,
    dtype: npt.DTypeLike = np.float32,
    place: Path | None = None,
) -> LogColumns:
    """Return the columns of a log; make them first if there are none.

    Args:
        progress: called with the share that is done, 0 to 1.
        dtype: of the numbers.
        place: folder of the columns, default `place_of(log)`.

    Raises LogFormatError or StorageError.
    """
    log = log_of(log)
    return _columns(_Folder(log, place or place_of(log), progress), dtype)


def kept_columns(log: Path, dtype: npt.DTypeLike = np.float32) -> LogColumns:
    """Return the stored columns of a log, even of an earlier state of it. Raises StorageError when
    there are none.
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
    """Return topics of one vehicle, by name without namespace; a topic without messages is empty.

    Raises LogFormatError or StorageError.
    """
    found = read_columns(log, dtype=dtype).topics
    return {name: found.get(f"/{vehicle}/{name}") or Topic(dtype=dtype) for name in wanted}
