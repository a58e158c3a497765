"""An MCAP file as it is written: lz4 chunks with message indexes, and an index at the end.

At 2500 messages a second, on board and at the station, the path of a message determines the cost
of logging: 2 µs for a single one, a quarter of a microsecond for one of a batch. A record is one
packed head and its payload, an index entry one packed pair, and numpy sorts batches by time. The
index entries of the chunks wait in a file (`LogFile.store_for_end`), as a run has 25 to 50 chunks a
second. The file is byte for byte that of the mcap library.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import lz4.frame
import numpy as np
import numpy.typing as npt
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    DataEnd,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from flight_log.file import LogFile
from flight_log.format import (
    CHUNK,
    CHUNK_INDEX,
    FOOTER,
    HEAD_BYTES,
    INDEX_ENTRY,
    INDEX_PLACE,
    LENGTH,
    MAGIC,
    MESSAGE,
    MESSAGE_INDEX,
    RECORD,
    message_record,
)

CHUNK_BYTES = 65536
_HEAD = struct.Struct(RECORD.format + MESSAGE.format[1:])
_OPCODE = int(Opcode.MESSAGE)
_LZ4 = b"lz4"
_INDEX_REST = struct.Struct("<QI3sQQ")
"""The rest of a chunk's index after its map: bytes of message indexes, compression, both sizes."""


class MessageBatch(NamedTuple):
    """N messages of one channel and one size, times in ns, oldest first."""

    channel_id: int
    payloads: npt.NDArray[Any]  # (N,), the payload is the item's bytes
    log_ns: npt.NDArray[np.int64]  # (N,)
    publish_ns: npt.NDArray[np.int64]  # (N,)


Message = tuple[int, bytes, int, int]
"""Channel, payload, log time and publish time, ns."""


class McapWriter:
    """Writer into `file`, which it neither syncs nor closes. Every method may raise StorageError.

    Args:
        chunk_bytes: a chunk above this size is closed after the message.
    """

    def __init__(self, file: LogFile, chunk_bytes: int = CHUNK_BYTES) -> None:
        self._file = file
        self._chunk_bytes = chunk_bytes
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: Counter[int] = Counter()  # messages by channel
        self._chunks = self._start_ns = self._end_ns = 0  # of all messages
        self._chunk = bytearray()
        self._entries: defaultdict[int, bytearray] = defaultdict(bytearray)  # by channel
        self._first_ns = self._last_ns = 0  # of the chunk's messages

    def start(self, profile: str = "ros2", library: str = "quadlab") -> None:
        self._file.write(MAGIC + _packed(Header(profile, library)))

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Register a schema; return its id."""
        schema = Schema(id=len(self._schemas) + 1, name=name, encoding=encoding, data=data)
        self._schemas.append(schema)
        self._chunk += _packed(schema)
        self._close_full()
        return schema.id

    def register_channel(
        self, topic: str, encoding: str, schema_id: int, metadata: dict[str, str]
    ) -> int:
        """Register a channel; return its id. `schema_id` 0: none."""
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic,
            message_encoding=encoding,
            schema_id=schema_id,
            metadata=metadata,
        )
        self._channels.append(channel)
        self._chunk += _packed(channel)
        self._close_full()
        return channel.id

    def add_attachment(self, record: Attachment) -> None:
        """Write an attachment at the file's current position, before the chunk being filled."""
        data = _packed(record)
        self._attachments.append(
            AttachmentIndex(
                offset=self._file.size,
                length=len(data),
                create_time=record.create_time,
                log_time=record.log_time,
                data_size=len(record.data),
                name=record.name,
                media_type=record.media_type,
            )
        )
        self._file.write(data)

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Write metadata at the current position of the file, as `add_attachment` does."""
        data = _packed(Metadata(metadata=values, name=name))
        self._metadata.append(MetadataIndex(offset=self._file.size, length=len(data), name=name))
        self._file.write(data)

    def add_message(
        self, channel_id: int, log_ns: int, payload: bytes, publish_ns: int, sequence: int = 0
    ) -> None:
        """Add a message to the chunk being filled; times in ns."""
        self._count(channel_id, 1, log_ns, log_ns)
        chunk = self._chunk
        self._entries[channel_id] += INDEX_ENTRY.pack(log_ns, len(chunk))
        length, number = MESSAGE.size + len(payload), sequence & 0xFFFF_FFFF
        chunk += _HEAD.pack(_OPCODE, length, channel_id, number, log_ns, publish_ns)
        chunk += payload
        if len(chunk) > self._chunk_bytes:
            self.flush()

    def add_messages(self, messages: Sequence[Message], sequence: int) -> None:
        """Add at least one message, in this order, numbered from `sequence` on: 1 µs each.

        A chunk is closed only after the last one.
        """
        channels, _, times, _ = zip(*messages, strict=True)
        first_ns, last_ns = min(times), max(times)
        for channel_id, count in Counter(channels).items():
            self._count(channel_id, count, first_ns, last_ns)
        place = len(self._chunk)
        parts: list[bytes] = []
        for number, (channel_id, payload, log_ns, publish_ns) in enumerate(messages, sequence):
            self._entries[channel_id] += INDEX_ENTRY.pack(log_ns, place)
            size = len(payload)
            place += HEAD_BYTES + size
            length, low = MESSAGE.size + size, number & 0xFFFF_FFFF
            parts += _HEAD.pack(_OPCODE, length, channel_id, low, log_ns, publish_ns), payload
        self._chunk += b"".join(parts)
        self._close_full()

    def add_batches(self, batches: Sequence[MessageBatch], sequence: int) -> None:
        """Add all messages of `batches` in the order of their log time, numbered from `sequence`
        on.

        Messages with equal times stay in the order of their batches; no batch may be empty. A chunk
        is closed only after the last message, so it may grow by all of them.
        """
        counts = [len(batch.log_ns) for batch in batches]
        types = [message_record(batch.payloads.dtype.itemsize) for batch in batches]
        order = np.argsort(np.concatenate([batch.log_ns for batch in batches]), kind="stable")
        sizes = np.repeat([kind.itemsize for kind in types], counts)
        ends = np.cumsum(sizes[order])
        places, numbers = np.empty_like(ends), np.empty_like(ends)
        places[order] = ends - sizes[order]
        numbers[order] = np.arange(sequence, sequence + len(order))
        data = np.empty(ends[-1], np.uint8)
        first = 0
        for batch, count, kind in zip(batches, counts, types, strict=True):
            log_ns, its = batch.log_ns, slice(first, first + count)
            first += count
            records = np.empty(count, kind)
            records["opcode"], records["length"] = _OPCODE, kind.itemsize - RECORD.size
            records["channel"], records["sequence"] = batch.channel_id, numbers[its]
            records["log_ns"], records["publish_ns"] = log_ns, batch.publish_ns
            records["payload"] = batch.payloads.view(kind["payload"])
            raw = np.dtype(("V", kind.itemsize))
            # Every position in `data` where a record of this size could be.
            stands = np.ndarray(len(data) - kind.itemsize + 1, raw, data, strides=(1,))
            stands[places[its]] = records.view(raw)

            self._count(batch.channel_id, count, int(log_ns.min()), int(log_ns.max()))
            entries = np.empty((count, 2), "<u8")
            entries[:, 0] = log_ns
            entries[:, 1] = places[its] + len(self._chunk)
            self._entries[batch.channel_id] += entries.tobytes()
        self._chunk += data.data
        self._close_full()

    def flush(self) -> None:
        """Write the chunk being filled; one without messages waits for its first message."""
        if not self._entries:
            return
        chunk, self._chunk = self._chunk, bytearray()
        entries, self._entries = self._entries, defaultdict(bytearray)
        self._chunks += 1
        times = self._first_ns, self._last_ns
        stored = lz4.frame.compress(chunk)
        content = CHUNK.pack(*times, len(chunk), zlib.crc32(chunk), len(_LZ4))
        content += _LZ4 + LENGTH.pack(len(stored))
        head = RECORD.pack(Opcode.CHUNK, len(content) + len(stored)) + content
        begin, length = self._file.size, len(head) + len(stored)
        parts, places, place = [head, stored], b"", begin + length
        for channel_id, pairs in entries.items():
            places += INDEX_PLACE.pack(channel_id, place)
            index = MESSAGE_INDEX.pack(channel_id, len(pairs))
            size = len(index) + len(pairs)
            parts += [RECORD.pack(Opcode.MESSAGE_INDEX, size), index, pairs]
            place += RECORD.size + size
        indexed = (
            CHUNK_INDEX.pack(*times, begin, length, len(places))
            + places
            + _INDEX_REST.pack(place - begin - length, len(_LZ4), _LZ4, len(stored), len(chunk))
        )
        self._file.write(b"".join(parts))
        self._file.store_for_end(RECORD.pack(Opcode.CHUNK_INDEX, len(indexed)) + indexed)

    def finish(self) -> None:
        """Write the index and the end mark."""
        self.flush()
        self._file.write(_packed(DataEnd(0)))
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=self._chunks,
            message_count=self._counts.total(),
            message_end_time=self._end_ns,
            message_start_time=self._start_ns,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        groups: list[tuple[int, Iterable[bytes]]] = [
            (Opcode.SCHEMA, [_packed(*self._schemas)]),
            (Opcode.CHANNEL, [_packed(*self._channels)]),
            (Opcode.STATISTICS, [_packed(statistics)]),
            (Opcode.CHUNK_INDEX, self._file.stored()),
            (Opcode.ATTACHMENT_INDEX, [_packed(*self._attachments)]),
            (Opcode.METADATA_INDEX, [_packed(*self._metadata)]),
        ]
        begin, checksum, offsets = self._file.size, 0, []
        for opcode, pieces in groups:
            place = self._file.size
            for piece in pieces:
                checksum = zlib.crc32(piece, checksum)
                self._file.write(piece)
            offsets.append(
                SummaryOffset(
                    group_opcode=opcode, group_start=place, group_length=self._file.size - place
                )
            )
        end = _packed(*offsets) + RECORD.pack(Opcode.FOOTER, FOOTER.size)
        end += FOOTER.pack(begin, self._file.size, 0)[:-4]
        self._file.write(end + zlib.crc32(end, checksum).to_bytes(4, "little") + MAGIC)

    def _count(self, channel_id: int, count: int, first_ns: int, last_ns: int) -> None:
        """Count messages of the file and of the chunk."""
        self._start_ns = min(self._start_ns, first_ns) if self._counts else first_ns
        self._end_ns = max(self._end_ns, last_ns)
        self._counts[channel_id] += count
        is_first = not self._entries
        self._first_ns = first_ns if is_first else min(self._first_ns, first_ns)
        self._last_ns = last_ns if is_first else max(self._last_ns, last_ns)

    def _close_full(self) -> None:
        if len(self._chunk) > self._chunk_bytes:
            self.flush()


def _packed(*records: McapRecord) -> bytes:
    builder: Any = RecordBuilder()
    for record in records:
        record.write(builder)
    data: bytes = builder.end()
    return data
