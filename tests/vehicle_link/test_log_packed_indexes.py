"""A long run's index records: the library's to the byte, in a small part of its memory."""

from __future__ import annotations

import io
import tracemalloc

from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import ChunkIndex
from mcap.writer import CompressionType, Writer

from vehicle_link.log.packed_indexes import BLOCK, PackedIndexes
from vehicle_link.log.quick_writer import QuickWriter

CHANNELS = 16


def index(k: int) -> ChunkIndex:
    """Of chunk k of a run that closes one each 20 ms."""
    start = 9_000 * k
    return ChunkIndex(
        message_start_time=20_000_000 * k,
        message_end_time=20_000_000 * k + 19_000_000,
        chunk_start_offset=start,
        chunk_length=8_000 + k % 97,
        message_index_offsets={c: start + 8_000 + 60 * c + k % 7 for c in range(CHANNELS)},
        message_index_length=960,
        compression="lz4",
        compressed_size=7_900 + k % 97,
        uncompressed_size=12_000 + k % 13,
    )


def test_they_are_written_as_the_library_writes_them_however_often() -> None:
    packed, plain = PackedIndexes(), RecordBuilder()
    for k in range(1_000):
        packed.append(index(k))
        index(k).write(plain)
    expected = plain.end()
    assert len(expected) > 5 * BLOCK
    for _ in range(2):
        written = RecordBuilder()
        for one in packed:
            one.write(written)
        assert written.end() == expected


def test_they_take_a_tenth_of_the_memory_at_most() -> None:
    grown = []
    for kept in (list[ChunkIndex](), PackedIndexes()):
        tracemalloc.start()
        for k in range(3_000):
            kept.append(index(k))
        grown.append(tracemalloc.get_traced_memory()[0])
        tracemalloc.stop()
    print(f"{grown[0] / 3_000:.0f} and {grown[1] / 3_000:.0f} B a chunk")
    assert grown[1] < grown[0] / 10


def test_a_file_of_many_chunks_is_the_librarys() -> None:
    files = []
    for kind in (Writer, QuickWriter):
        files.append(io.BytesIO())
        writer = kind(files[-1], chunk_size=100, compression=CompressionType.LZ4)
        writer.start("ros2", "test")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channels = [writer.register_channel(f"/{k}", "cdr", schema) for k in range(8)]
        for k in range(4_000):
            writer.add_message(channels[k % 8], k, b"x" * 40, k)
        writer.finish()
    assert files[0].getvalue() == files[1].getvalue()
    reader = make_reader(io.BytesIO(files[1].getvalue()))
    summary = reader.get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) * 154 > 3 * BLOCK
    found = reader.iter_messages(["/3"], starting_at=1_000, ending_before=1_100)
    assert [message.log_time for _, _, message in found] == list(range(1_003, 1_100, 8))
