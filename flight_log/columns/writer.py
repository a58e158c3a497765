"""The columns of a log on disk: every topic's numbers, texts and payloads as Arrow files.

A topic is one Arrow IPC file, uncompressed, so that it can be mapped: `received_ns`, `stamp_ns`,
float64 numbers by path, `payload` for the topics in WHOLE. Values that hardly ever change (most
numbers of most topics, texts) are stored in `log.json`, by the row where they change.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xxhash

from flight_log import payload_columns, payload_layout, topic_columns
from flight_log.payload_layout import HEADER_STAMP
from flight_log.topic_columns import ColumnReader, Columns

VERSION = 1
"""Version of the files; columns of another version are made again."""
READERS = payload_layout, payload_columns, topic_columns
"""Modules that read messages. Columns with topics that other ones could not read are made again."""
INDEX = "log.json"
WHOLE = (
    *("/events", "/marks", "/parameter_changes"),
    *("/tracker_pose", "/tracker_position", "/bearings", "/sweeps"),
    "_picture",
)
"""Ends of the names of topics whose messages are read one by one, so that payloads are stored."""
RECEIVED, STAMP, HEADER, PAYLOAD = "received_ns", "stamp_ns", "header_delay_ns", "payload"
ROWS = 1 << 20
"""Rows that are written at once, and are contiguous in the file."""
PIECE = 1 << 20
HELD = 1 << 15
"""Number of a column's values that are held in memory before they go to a file."""


class _Growing:
    """Values of one column that arrive in pieces; held in memory up to HELD, then in a file, and
    only once they differ.
    """

    def __init__(self, path: Path, dtype: npt.DTypeLike) -> None:
        self.dtype = np.dtype(dtype)
        self._path = path
        self._held: list[npt.NDArray[Any]] = []
        self._held_count = self._filed_count = 0
        self.first: Any = None
        self.count = 0
        self.is_constant = True

    def extend(self, values: npt.NDArray[Any]) -> None:
        """Add values, shape (N,). Raises OSError."""
        if not len(values):
            return
        if self.is_constant:
            if not self.count:
                self.first = values[0].item()
            is_number = self.first == self.first
            same = values == self.first if is_number else np.isnan(values)
            if np.count_nonzero(same) < len(values):
                self.is_constant = False
                self._append(np.full(self.count, self.first, self.dtype))
        if not self.is_constant:
            self._append(values.astype(self.dtype, copy=False))
        self.count += len(values)

    def fill(self, count: int) -> None:
        """Add NaN up to `count` values, for messages without this number."""
        if count > self.count:
            self.extend(np.full(count - self.count, np.nan))

    def _append(self, values: npt.NDArray[Any]) -> None:
        self._held.append(values)
        self._held_count += len(values)
        if self._held_count > HELD:
            self._file_held()

    def _file_held(self) -> None:
        with self._path.open("ab") as file:
            np.concatenate(self._held).tofile(file)
        self._filed_count += self._held_count
        self._held, self._held_count = [], 0

    def read(self) -> npt.NDArray[Any]:
        """Return all values, (count,), mapped if there are many."""
        if self.is_constant:
            return np.full(self.count, self.first, self.dtype)
        if not self._filed_count:
            return np.concatenate(self._held)
        if self._held:
            self._file_held()
        return np.memmap(self._path, self.dtype, "r")


class _Topic:
    """The messages of a topic as they are collected; only those of its first type."""

    def __init__(self, first: Columns, folder: Path) -> None:
        self.type_name, self._folder, self.count = first.type_name, folder, 0
        folder.mkdir()
        self._times = {name: _Growing(folder / name, np.int64) for name in (RECEIVED, STAMP)}
        self._header = _Growing(folder / HEADER, np.int64)
        self._numbers: dict[str, _Growing] = {}
        self._texts: dict[str, list[tuple[int, str]]] = {}
        self._payload_bytes: list[int] = []

    def extend(self, columns: Columns) -> None:
        before = self.count
        self.count += len(columns.log_ns)
        self._times[RECEIVED].extend(columns.log_ns)
        self._times[STAMP].extend(columns.publish_ns)
        header = [columns.numbers.pop(name, None) for name in HEADER_STAMP]
        if all(one is not None for one in header):
            seconds, rest = (np.asarray(one).astype(np.int64) for one in header)
            self._header.extend(seconds * 1_000_000_000 + rest - columns.publish_ns)
        for path, values in columns.numbers.items():
            number = self._numbers.get(path)
            if number is None:
                file = self._folder / f"number{len(self._numbers)}"
                number = self._numbers[path] = _Growing(file, np.float64)
            number.fill(before)
            number.extend(values)
        for path, changes in columns.texts.items():
            self._texts.setdefault(path, []).extend((before + k, text) for k, text in changes)
        if columns.payloads:
            self._payload_bytes += map(len, columns.payloads)
            with (self._folder / PAYLOAD).open("ab") as out:
                out.writelines(columns.payloads)

    def write(self, file: Path) -> dict[str, Any]:
        """Write the Arrow file; return the topic's entry of `log.json`. Raises OSError."""
        import pyarrow as pa

        constants: dict[str, float] = {}
        arrays = {name: one.read() for name, one in self._times.items()}
        has_header = self._header.count == self.count
        delay = int(self._header.first) if has_header and self._header.is_constant else None
        if has_header and delay is None:
            arrays[HEADER] = self._header.read()
        for path, number in self._numbers.items():
            number.fill(self.count)
            if number.is_constant:
                constants[path] = float(number.first)
            else:
                arrays[path] = number.read()
        types = [pa.from_numpy_dtype(one.dtype) for one in arrays.values()]
        fields = list(map(pa.field, arrays, types))
        places = None
        if self._payload_bytes:
            fields.append(pa.field(PAYLOAD, pa.large_binary()))
            places = np.concatenate([[0], np.cumsum(self._payload_bytes, dtype=np.int64)])
            payloads = np.memmap(self._folder / PAYLOAD, np.uint8, "r")
        schema = pa.schema(fields)
        with file.open("wb") as sink, pa.ipc.new_file(sink, schema) as writer:
            for begin in range(0, self.count, ROWS):
                end = min(begin + ROWS, self.count)
                values = (pa.py_buffer(one[begin:end]) for one in arrays.values())
                typed = zip(types, values, strict=True)  # pa.array would load pandas
                batch = [
                    pa.Array.from_buffers(kind, end - begin, [None, one]) for kind, one in typed
                ]
                if places is not None:
                    at = np.ascontiguousarray(places[begin : end + 1])
                    buffers = [None, pa.py_buffer(at), pa.py_buffer(payloads)]
                    batch.append(pa.Array.from_buffers(pa.large_binary(), end - begin, buffers))
                writer.write_batch(pa.record_batch(batch, schema=schema))
        return {
            "file": file.name,
            "bytes": file.stat().st_size,
            "digest": digest(file),
            "type": self.type_name,
            "count": self.count,
            "numbers": list(self._numbers),
            "constants": constants,
            "texts": self._texts,
            "header_delay_ns": delay,
            "has_header": has_header,
        }


def write_columns(
    log: Path, folder: Path, identity: list[int], progress: Callable[[float], None]
) -> None:
    """Write the columns of a log into a new folder. Raises OSError, LogFormatError, StorageError.

    Args:
        identity: of the log, stored with them.
        progress: called with the share that is done, 0 to 1.
    """
    scratch = folder / "scratch"
    scratch.mkdir(parents=True)
    reader = ColumnReader(log, WHOLE, header_stamps=True)
    topics: dict[str, _Topic] = {}
    for batch in reader:
        for columns in batch.columns:
            topic = topics.get(columns.topic)
            if topic is None:
                topic = topics[columns.topic] = _Topic(columns, scratch / str(len(topics)))
            if topic.type_name == columns.type_name:
                topic.extend(columns)
        progress(0.8 * batch.share)
    found: dict[str, Any] = {}
    for number, name in enumerate(list(topics)):
        found[name] = topics.pop(name).write(folder / f"{number}.arrow")
        shutil.rmtree(scratch / str(number))
        progress(0.8 + 0.2 * (number + 1) / (number + 1 + len(topics)))
    shutil.rmtree(scratch)
    raw = reader.log
    schemas = {
        one.topic: raw.schemas[one.schema_id]
        for one in raw.channels.values()
        if one.topic in found and one.topic.endswith(WHOLE)
    }
    text = json.dumps(
        {
            "version": VERSION,
            "reader": reader_digest(),
            "log": str(log.resolve()),
            "identity": identity,
            "topics": found,
            "schemas": {name: [one.name, one.data.decode()] for name, one in schemas.items()},
            "attachments": {name: data.decode("latin-1") for name, data in raw.attachments.items()},
            "metadata": raw.metadata,
            "tear": raw.tear,
            "damaged_chunks": raw.damaged_chunks,
            "damaged_records": raw.damaged_records,
            "problems": reader.problems,
        },
        separators=(",", ":"),
    )
    data = text.encode()
    (folder / INDEX).write_bytes(f"{xxhash.xxh3_64_hexdigest(data)}\n".encode() + data)


@cache
def reader_digest() -> str:
    """Return the checksum of the sources that read messages."""
    return "".join(digest(Path(one.__file__)) for one in READERS if one.__file__)


def digest(file: Path) -> str:
    """Return a file's checksum, read in pieces. Raises OSError."""
    found = xxhash.xxh3_64()
    piece = bytearray(PIECE)
    with file.open("rb", buffering=0) as source:
        while count := source.readinto(piece):
            found.update(memoryview(piece)[:count])
    return found.hexdigest()
