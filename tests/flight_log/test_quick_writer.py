"""The quick writer makes the same file as the library's own, byte for byte."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from flight_log.aside import Aside
from flight_log.quick_writer import MessageBatch, OneMessage, QuickWriter


def written(chunk_size: int, *aside: Aside) -> bytes:
    """By the library's own writer, or by the quick one, which puts aside."""
    kind: type[Any] = QuickWriter if aside else Writer
    random = np.random.default_rng(3)
    file = io.BytesIO()
    writer = kind(file, *aside, chunk_size=chunk_size, compression=CompressionType.LZ4)
    writer.start("ros2", "quadlab")
    schema = writer.register_schema("a/A", "ros2msg", b"float64 x")
    channels = [writer.register_channel(f"/t{k}", "cdr", schema, {}) for k in range(3)]
    for k in range(500):
        size, late = int(random.integers(0, 900)), int(random.integers(0, 50))
        writer.add_message(channels[k % 3], 1000 * (k + 1) - late, random.bytes(size), 900 * k, k)
        if k % 120 == 0:
            writer.flush()
    writer.finish()
    return file.getvalue()


@pytest.fixture
def aside(tmp_path: Path) -> Iterator[Aside]:
    with closing(Aside(tmp_path)) as made:
        yield made


@pytest.mark.parametrize("chunk_size", [1, 1000, 65536])
def test_the_file_is_the_librarys_byte_for_byte(chunk_size: int, aside: Aside) -> None:
    assert written(chunk_size, aside) == written(chunk_size)


@pytest.mark.filterwarnings("ignore:.*_time is deprecated:DeprecationWarning")  # for mcap 1.2, too
def test_the_librarys_reader_finds_every_message_by_time(aside: Aside) -> None:
    file = written(1000, aside)
    reader = make_reader(io.BytesIO(file))
    found = [m.sequence for _, _, m in reader.iter_messages(start_time=100_000, end_time=200_000)]
    assert len(found) == pytest.approx(100, abs=2)
    assert len(list(make_reader(io.BytesIO(file)).iter_messages())) == 500


def test_many_at_once_make_the_file_of_them_one_by_one(aside: Aside) -> None:
    random = np.random.default_rng(7)
    rows = [
        OneMessage(1 + k % 3, random.bytes(int(random.integers(0, 90))), 1000 + 7 * k % 40, k)
        for k in range(50)
    ]

    def new() -> tuple[io.BytesIO, QuickWriter]:
        file = io.BytesIO()
        writer = QuickWriter(file, aside, chunk_size=60_000, compression=CompressionType.LZ4)
        writer.start("ros2", "quadlab")
        schema = writer.register_schema("a/A", "ros2msg", b"float64 x")
        for k in range(3):
            writer.register_channel(f"/t{k}", "cdr", schema, {})
        return file, writer

    together, writer = new()
    writer.add_messages(rows[:20], 1)
    writer.add_messages(rows[20:], 21)
    writer.finish()
    one_by_one, writer = new()
    for number, (channel, payload, log_ns, publish_ns) in enumerate(rows, 1):
        writer.add_message(channel, log_ns, payload, publish_ns, number)
    writer.finish()
    assert together.getvalue() == one_by_one.getvalue()


def test_batches_make_the_file_of_their_messages_one_by_one_in_the_order_of_time(
    aside: Aside,
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

    def new() -> tuple[io.BytesIO, QuickWriter]:
        file = io.BytesIO()
        writer = QuickWriter(file, aside, compression=CompressionType.LZ4)
        writer.start("ros2", "quadlab")
        schema = writer.register_schema("a/A", "ros2msg", b"float64 x")
        for channel in (1, 2, 3):
            assert writer.register_channel(f"/t{channel}", "cdr", schema, {}) == channel
        # Of every channel, so that both files list the channels of the index in one order.
        for channel in (1, 2, 3):
            writer.add_message(channel, 900, b"first", 900, channel)
        return file, writer

    single, writer = new()
    for number, (log_ns, channel, payload) in enumerate(rows):
        writer.add_message(channel, log_ns, payload, log_ns - 5, 10 + number)
    writer.finish()
    at_once, writer = new()
    writer.add_batches(batches, 10)
    writer.finish()
    assert at_once.getvalue() == single.getvalue()
