"""A long run's index records: the library's to the byte, however long, in the same memory."""

from __future__ import annotations

import io
import itertools
import tempfile
import tracemalloc
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import ChunkIndex
from mcap.writer import CompressionType, Writer

from flight_log import LogWriter, read_log, recover
from flight_log.aside import Aside
from flight_log.chunk_indexes import BLOCK, ChunkIndexes
from flight_log.quick_writer import QuickWriter
from quadrotor.errors import StorageError

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


@pytest.fixture
def aside(tmp_path: Path) -> Iterator[Aside]:
    with closing(Aside(tmp_path)) as made:
        yield made
    assert not list(tmp_path.iterdir())


def test_they_are_written_as_the_library_writes_them_however_often(aside: Aside) -> None:
    kept, plain = ChunkIndexes(aside), RecordBuilder()
    for part in range(2):
        for k in range(1_000 * part, 1_000 * part + 1_000):
            kept.append(index(k))
            index(k).write(plain)
        expected = plain.end()
        plain.write(expected)
        assert len(expected) > 5 * BLOCK
        for _ in range(2):
            written = RecordBuilder()
            for one in kept:
                one.write(written)
            assert written.end() == expected


def test_ten_times_as_many_take_no_more_memory(aside: Aside) -> None:
    kept, grown = ChunkIndexes(aside), []
    tracemalloc.start()
    for k in range(10_000):
        kept.append(index(k))
        if k + 1 in (1_000, 10_000):
            grown.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    print(f"{grown} B after 1000 and 10000 chunks")
    assert grown[1] < grown[0] + 2 * BLOCK


def test_a_disk_without_room_for_them_is_said_and_the_log_can_be_mended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.mcap"
    writer = LogWriter(path, {"run_id": "r"}, {}, chunk_age_ns=1)

    def write_for_ever() -> None:
        for k in itertools.count():
            writer.write("/a", "std_msgs/String", b"\0\1\0\0", k, k)

    with open("/dev/full", "r+b", buffering=0) as full:
        monkeypatch.setattr(tempfile, "TemporaryFile", lambda **options: full)
        with pytest.raises(StorageError, match=f"{tmp_path}: No space left on device"):
            write_for_ever()
    monkeypatch.undo()
    assert not writer.close()
    written = writer.message_count
    assert recover(path).messages == written > BLOCK // 100
    assert len(list(read_log(path))) == written


def test_a_file_of_many_chunks_is_the_librarys(aside: Aside) -> None:
    files = []
    options: dict[str, Any] = {"chunk_size": 100, "compression": CompressionType.LZ4}
    for make in (Writer, lambda file, **rest: QuickWriter(file, aside, **rest)):
        files.append(io.BytesIO())
        writer = make(files[-1], **options)
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
