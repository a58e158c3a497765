"""The writer makes the same file as the mcap library's, byte for byte, however long it is."""

from __future__ import annotations

import io
import itertools
import tempfile
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Attachment
from mcap.writer import CompressionType, Writer

from flight_log import LogWriter, read_log, recover
from flight_log.file import PIECE, LogFile
from flight_log.mcap_writer import McapWriter, MessageBatch
from quadrotor.errors import StorageError

LZ4 = CompressionType.LZ4


@pytest.fixture
def file(tmp_path: Path) -> Iterator[LogFile]:
    with closing(LogFile(tmp_path / "ours.mcap")) as made:
        yield made
    assert [path.name for path in tmp_path.iterdir()] == ["ours.mcap"]


def fill(writer: Any, attach: Any) -> None:
    """Write messages of random sizes on three channels, an attachment and metadata."""
    random = np.random.default_rng(3)
    writer.start("ros2", "quadlab")
    schema = writer.register_schema("a/A", "ros2msg", b"float64 x")
    channels = [writer.register_channel(f"/t{k}", "cdr", schema, {"q": str(k)}) for k in range(3)]
    for k in range(500):
        size, late = int(random.integers(0, 900)), int(random.integers(0, 50))
        writer.add_message(channels[k % 3], 1000 * (k + 1) - late, random.bytes(size), 900 * k, k)
        if k % 120 == 0:
            writer.flush()
    attach(Attachment(create_time=3, log_time=4, name="a.json", media_type="b", data=b"{}"))
    writer.add_metadata("quadlab.run", {"run_id": "r", "who": "é"})
    writer.finish()


def by_library(chunk_size: int) -> bytes:
    out = io.BytesIO()
    writer = Writer(out, chunk_size=chunk_size, compression=LZ4)
    fill(writer, lambda one: writer.add_attachment(**vars(one)))
    return out.getvalue()


@pytest.mark.parametrize("chunk_size", [1, 1000, 65536])
def test_the_file_is_the_librarys_byte_for_byte(chunk_size: int, file: LogFile) -> None:
    writer = McapWriter(file, chunk_size)
    fill(writer, writer.add_attachment)
    assert file.path.read_bytes() == by_library(chunk_size)


@pytest.mark.filterwarnings("ignore:.*_time is deprecated:DeprecationWarning")  # for mcap 1.2, too
def test_the_librarys_reader_finds_every_message_by_time(file: LogFile) -> None:
    writer = McapWriter(file, 1000)
    fill(writer, writer.add_attachment)
    reader = make_reader(io.BytesIO(file.path.read_bytes()))
    found = [m.sequence for _, _, m in reader.iter_messages(start_time=100_000, end_time=200_000)]
    assert len(found) == pytest.approx(100, abs=2)
    assert len(list(reader.iter_messages())) == 500


def made(path: Path, channels: int, chunk_bytes: int, write: Callable[[McapWriter], None]) -> bytes:
    """Return the file of a writer with so many channels, after `write`."""
    with closing(LogFile(path)) as out:
        writer = McapWriter(out, chunk_bytes)
        writer.start()
        schema = writer.register_schema("a/A", "ros2msg", b"float64 x")
        for channel in range(1, channels + 1):
            assert writer.register_channel(f"/t{channel}", "cdr", schema, {}) == channel
        write(writer)
        writer.finish()
    return path.read_bytes()


def test_many_at_once_make_the_file_of_them_one_by_one(tmp_path: Path) -> None:
    random = np.random.default_rng(7)
    rows = [
        (1 + k % 3, random.bytes(int(random.integers(0, 90))), 1000 + 7 * k % 40, k)
        for k in range(50)
    ]

    def together(writer: McapWriter) -> None:
        writer.add_messages(rows[:20], 1)
        writer.add_messages(rows[20:], 21)

    def one_by_one(writer: McapWriter) -> None:
        for number, (channel, payload, log_ns, publish_ns) in enumerate(rows, 1):
            writer.add_message(channel, log_ns, payload, publish_ns, number)

    files = [
        made(tmp_path / f"{k}.mcap", 3, 60_000, write)
        for k, write in enumerate((together, one_by_one))
    ]
    assert files[0] == files[1]


def test_batches_make_the_file_of_their_messages_one_by_one_in_the_order_of_time(
    tmp_path: Path,
) -> None:
    random = np.random.default_rng(5)
    sizes, counts = (40, 7, 300), (30, 11, 1)
    batches = []
    for channel, (size, count) in enumerate(zip(sizes, counts, strict=True), 1):
        payloads = np.frombuffer(random.bytes(size * count), f"V{size}")
        log_ns = np.sort(random.integers(1000, 1020, count))  # many of the same time
        batches.append(MessageBatch(channel, payloads, log_ns, log_ns - 5))
    rows = [
        (int(batch.log_ns[k]), batch.channel_id, batch.payloads[k].tobytes())
        for batch in batches
        for k in range(len(batch.log_ns))
    ]
    rows.sort(key=lambda row: row[0])

    def first(writer: McapWriter) -> None:
        """Write a first message of every channel, so that both files index them in one order."""
        for channel in (1, 2, 3):
            writer.add_message(channel, 900, b"first", 900, channel)

    def one_by_one(writer: McapWriter) -> None:
        first(writer)
        for number, (log_ns, channel, payload) in enumerate(rows):
            writer.add_message(channel, log_ns, payload, log_ns - 5, 10 + number)

    def at_once(writer: McapWriter) -> None:
        first(writer)
        writer.add_batches(batches, 10)

    files = [
        made(tmp_path / f"{k}.mcap", 3, 65536, write)
        for k, write in enumerate((at_once, one_by_one))
    ]
    assert files[0] == files[1]


def test_ten_times_as_many_chunks_take_no_more_memory(file: LogFile) -> None:
    writer, grown = McapWriter(file, 1), []
    writer.start()
    channel = writer.register_channel("/a", "cdr", 0, {})
    tracemalloc.start()
    for k in range(10_000):
        writer.add_message(channel, k, b"x", k)
        if k + 1 in (1_000, 10_000):
            grown.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    print(f"{grown} B after 1000 and 10000 chunks")
    assert grown[1] < grown[0] + 2 * PIECE


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
    assert recover(path).messages == written > PIECE // 100
    assert len(list(read_log(path))) == written


def test_a_file_of_many_chunks_is_the_librarys(file: LogFile) -> None:
    def write(writer: Any) -> None:
        writer.start("ros2", "test")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channels = [writer.register_channel(f"/{k}", "cdr", schema, {}) for k in range(8)]
        for k in range(4_000):
            writer.add_message(channels[k % 8], k, b"x" * 40, k)
        writer.finish()

    theirs = io.BytesIO()
    write(Writer(theirs, chunk_size=100, compression=LZ4))
    write(McapWriter(file, 100))
    assert file.path.read_bytes() == theirs.getvalue()
    summary = make_reader(io.BytesIO(theirs.getvalue())).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) * 154 > 3 * PIECE, "it was put aside"
