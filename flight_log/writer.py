"""Writer of a run's MCAP file: profile ros2, schemas ros2msg, CDR, lz4 chunks of 64 KiB.

Chunks are small and closed after 40 ms at the latest, and the file is unbuffered: a killed process
loses at most that. `close` writes the index at the end; a file without it is repaired by `recover`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from mcap.records import Attachment

from flight_log.file import LogFile
from flight_log.mcap_writer import McapWriter, MessageBatch
from quadrotor.errors import StorageError
from vehicle_link import messages

RUN_METADATA = "quadlab.run"
FILLED_METADATA = "quadlab.filled"
CHUNK_AGE_NS = 40_000_000
MEDIA_TYPES = {".json": "application/json", ".toml": "application/toml", ".py": "text/x-python"}


class Message(NamedTuple):
    """A message with the arguments of `LogWriter.write`."""

    topic: str
    type_name: str
    payload: bytes
    log_ns: int
    publish_ns: int


class Batch(NamedTuple):
    """N messages of one topic whose payloads have the same size, oldest first."""

    topic: str
    type_name: str
    payloads: npt.NDArray[np.generic]  # (N,), an item's bytes are the payload in CDR
    log_ns: npt.NDArray[np.int64]  # (N,), ns of reception
    publish_ns: npt.NDArray[np.int64]  # (N,), ns, the source's stamp


class LogWriter:
    """Writer of a log. Not thread-safe: only one thread may write.

    Args:
        path: a new file; missing folders are made.
        run: the metadata record `quadlab.run` (run id, vehicle, operator, git revision, …).
        attachments: name → bytes, written before the first message so that a crash keeps them.
        chunk_age_ns: log time after which a chunk is closed, full or not.

    Raises:
        StorageError: here and in every method, when the disk fails.
    """

    def __init__(
        self,
        path: Path,
        run: Mapping[str, str],
        attachments: Mapping[str, bytes],
        chunk_age_ns: int = CHUNK_AGE_NS,
    ) -> None:
        self.path = path
        self._file = LogFile(path)
        self._channels: dict[tuple[str, str], int] = {}
        self._schemas: dict[str, int] = {}
        self._chunk_age_ns = chunk_age_ns
        self._chunk_start_ns = -chunk_age_ns
        self._broken: StorageError | None = None
        self._closed = False
        self._whole = False  # closed with its index
        self.message_count = 0
        self._writer = McapWriter(self._file)
        self._add_message = self._writer.add_message
        self._guarded_start(run, attachments)

    @property
    def size(self) -> int:
        """Return the number of bytes in the file so far."""
        return self._file.size

    @property
    def channels(self) -> dict[int, tuple[str, str]]:
        """Return id → topic and type of the channels with messages so far; thread-safe."""
        found = self._channels.copy()
        return {k: (topic, messages.ros_name(kind)) for (topic, kind), k in found.items()}

    def is_in_place(self) -> bool:
        """Return False when another process removed the file or its folder."""
        return self._file.is_in_place()

    def write(
        self, topic: str, type_name: str, payload: bytes, log_ns: int, publish_ns: int
    ) -> None:
        """Write one message: `payload` in CDR, reception and source stamp in ns.

        A source stamp before the epoch, which no log can hold, is written as 0.
        """
        if self._broken is not None:
            raise self._broken
        try:
            channel = self._channels.get((topic, type_name))
            if channel is None:
                channel = self._register(topic, type_name)
            self.message_count += 1
            self._add_message(channel, log_ns, payload, max(0, publish_ns), self.message_count)
            self._close_old_chunk(log_ns)
        except StorageError as error:
            self._broken = error
            raise

    def write_many(self, messages: Sequence[tuple[str, str, bytes, int, int]]) -> None:
        """Write many messages, each with the arguments of `write`, in this order; a chunk may grow
        by all of them.
        """
        with self._guarded():
            if not messages:
                return
            known, register = self._channels, self._register
            rows = [
                (known.get((of, kind)) or register(of, kind), data, log, at if at > 0 else 0)
                for of, kind, data, log, at in messages
            ]
            self._writer.add_messages(rows, self.message_count + 1)
            self.message_count += len(rows)
            self._close_old_chunk(messages[-1][3])

    def write_batches(self, batches: Sequence[Batch]) -> None:
        """Write many messages in the order of their log time; at equal times, in that of `batches`.

        No batch may be empty. Writes whole batches: a chunk may grow by all of them.
        """
        with self._guarded():
            channels = [
                self._channels.get(batch[:2]) or self._register(batch.topic, batch.type_name)
                for batch in batches
            ]
            self._writer.add_batches(
                [MessageBatch(c, *b[2:]) for c, b in zip(channels, batches, strict=True)],
                self.message_count + 1,
            )
            self.message_count += sum(len(batch.log_ns) for batch in batches)
            self._close_old_chunk(max(int(batch.log_ns[-1]) for batch in batches))

    def close_chunk(self) -> None:
        """Pass everything written so far to the kernel, so that a killed process keeps it."""
        with self._guarded():
            self._writer.flush()

    def flush(self) -> None:
        """Close the chunk and flush everything to the disk (fdatasync)."""
        self.close_chunk()
        with self._guarded():
            self._file.sync()

    def sync(self) -> None:
        """Flush closed chunks to the disk (fdatasync); thread-safe."""
        self._file.sync()

    def attach(self, name: str, data: bytes) -> None:
        """Write one more attachment, at the current position of the file."""
        kind = MEDIA_TYPES.get(Path(name).suffix, "")
        record = Attachment(create_time=0, log_time=0, name=name, media_type=kind, data=data)
        with self._guarded():
            self._writer.add_attachment(record)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        with self._guarded():
            self._writer.add_metadata(name, dict(values))

    def close(self) -> bool:
        """Write the index and close; a second call does nothing.

        Returns whether the file has its index; it has none if an earlier write failed.
        """
        if self._closed:
            return self._whole
        self._closed = True
        try:
            if self._broken is None:
                self._writer.finish()
                self._file.sync()
                self._whole = True
        finally:
            self._file.close()
            self._broken = StorageError(f"{self.path} is closed")
        return self._whole

    def __enter__(self) -> LogWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """Raise in every call the first error of the disk."""
        if self._broken is not None:
            raise self._broken
        try:
            yield
        except StorageError as error:
            self._broken = error
            raise

    def _close_old_chunk(self, log_ns: int) -> None:
        # A clock that was set back must not keep the chunk open.
        if not 0 <= log_ns - self._chunk_start_ns < self._chunk_age_ns:
            self._chunk_start_ns = log_ns
            self._writer.flush()

    def _guarded_start(self, run: Mapping[str, str], attachments: Mapping[str, bytes]) -> None:
        try:
            self._writer.start()
            self.add_metadata(RUN_METADATA, run)
            for name, data in attachments.items():
                self.attach(name, data)
        except StorageError:
            with suppress(OSError, StorageError):
                self.path.unlink(missing_ok=True)  # it holds nothing yet
                self._file.close()
            raise

    def _register(self, topic: str, type_name: str) -> int:
        name = messages.ros_name(type_name)
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(
                name, "ros2msg", messages.definition(type_name).encode()
            )
        channel = self._writer.register_channel(
            topic,
            "cdr",
            self._schemas[name],
            {"offered_qos_profiles": "[]", "topic_type_hash": messages.type_hash(type_name)},
        )
        self._channels[topic, type_name] = channel
        return channel
