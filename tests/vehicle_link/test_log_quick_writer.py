"""The quick writer makes the same file as the library's own, byte for byte."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from vehicle_link.log.quick_writer import QuickWriter


def written(kind: type[Any], chunk_size: int) -> bytes:
    random = np.random.default_rng(3)
    file = io.BytesIO()
    writer = kind(file, chunk_size=chunk_size, compression=CompressionType.LZ4)
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


@pytest.mark.parametrize("chunk_size", [1, 1000, 65536])
def test_the_file_is_the_librarys_byte_for_byte(chunk_size: int) -> None:
    assert written(QuickWriter, chunk_size) == written(Writer, chunk_size)


def test_the_librarys_reader_finds_every_message_by_time() -> None:
    reader = make_reader(io.BytesIO(written(QuickWriter, 1000)))
    found = [m.sequence for _, _, m in reader.iter_messages(start_time=100_000, end_time=200_000)]
    assert len(found) == pytest.approx(100, abs=2)
    assert len(list(make_reader(io.BytesIO(written(QuickWriter, 1000))).iter_messages())) == 500
