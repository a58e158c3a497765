"""Times of a log read from its index, compared with the library's."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from flight_log import LogWriter, recover
from flight_log.index import read_index
from quadrotor.errors import LogFormatError, StorageError

TYPES = {"/quad1/a": "std_msgs/Header", "/quad1/b": "rcl_interfaces/Log"}


def write(path: Path, count: int = 400) -> Path:
    """Write alternating messages 1 ms apart, in many chunks."""
    random = np.random.default_rng(1)
    with LogWriter(
        path, {"run_id": path.stem}, {"notes.json": b"{}"}, chunk_age_ns=5 * 10**6
    ) as log:
        for k in range(count):
            topic = "/quad1/b" if k % 7 == 3 else "/quad1/a"
            log.write(topic, TYPES[topic], random.bytes(300), 10**9 + 10**6 * k, 10**9)
    return path


def test_it_is_what_the_library_reads(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mcap")
    index = read_index(path)
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert index.start_ns == summary.statistics.message_start_time
    assert index.end_ns == summary.statistics.message_end_time
    assert not index.recovered


def test_a_mended_file_says_so(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mcap")
    os.truncate(path, path.stat().st_size // 2)
    with pytest.raises(LogFormatError, match=r"log\.mcap has no index that can be read"):
        read_index(path)
    recover(path)
    assert read_index(path).recovered


def test_an_empty_log_has_no_times(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mcap", 0)
    index = read_index(path)
    assert (index.start_ns, index.end_ns) == (0, 0)


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n" * 2, b"x" * 100, b"\0" * 5])
def test_what_is_no_log_has_no_index(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(content)
    with pytest.raises(LogFormatError):
        read_index(path)
    with pytest.raises(StorageError):
        read_index(tmp_path / "none.mcap")


def test_a_damaged_index_is_refused_or_read_but_never_a_crash(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mcap")
    content = bytearray(path.read_bytes())
    random = np.random.default_rng(2)
    for _ in range(200):
        damaged = content.copy()
        for place in random.integers(len(content) - 6000, len(content), 20):
            damaged[place] = random.integers(256)
        path.write_bytes(damaged)
        with suppress(LogFormatError):
            read_index(path)
