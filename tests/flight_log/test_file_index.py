"""The index of a log read by itself: as the library reads it, and stretches of whole chunks."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from flight_log import LogWriter, recover
from flight_log.index import FileIndex, read_index
from quadrotor.errors import LogFormatError, StorageError

TYPES = {"/quad1/a": "std_msgs/Header", "/quad1/b": "rcl_interfaces/Log"}


def write(path: Path, count: int = 400) -> Path:
    """Messages 1 ms apart by turns, in many chunks."""
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
    names = {s.id: s.name for s in summary.schemas.values()}
    assert index.channels == {
        c.id: (c.topic, names[c.schema_id]) for c in summary.channels.values()
    }
    chunks = summary.chunk_indexes
    assert len(chunks) > 50
    assert index.starts_ns.tolist() == [c.message_start_time for c in chunks]
    assert index.ends_ns.tolist() == [c.message_end_time for c in chunks]
    assert index.begins.tolist() == [c.chunk_start_offset for c in chunks]
    assert index.ends[:-1].tolist() == index.begins[1:].tolist(), "nothing between two chunks"


def test_without_chunks_it_tells_the_times_of_the_file(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mcap")
    whole, short = read_index(path), read_index(path, chunks=False)
    assert (short.start_ns, short.end_ns) == (whole.start_ns, whole.end_ns)
    assert short.channels == {}
    assert len(short.begins) == 0


def test_a_mended_file_says_so(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mcap")
    os.truncate(path, path.stat().st_size // 2)
    with pytest.raises(LogFormatError, match=r"log\.mcap has no index that can be read"):
        read_index(path)
    recover(path)
    assert read_index(path).recovered


def test_an_empty_log_has_no_stretches(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mcap", 0)
    index = read_index(path)
    assert (index.start_ns, index.end_ns) == (0, 0)
    assert index.stretch(0, 10**9, 0) == (0, 0)


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


def index_of(*chunks: tuple[int, int]) -> FileIndex:
    """Of chunks of 100 bytes with these first and last log times."""
    starts, ends = np.array(chunks, np.int64).T
    places = 1000 + 100 * np.arange(len(chunks) + 1)
    return FileIndex(
        int(starts[0]), int(ends[-1]), False, {}, starts, ends, places[:-1], places[1:]
    )


@pytest.mark.parametrize(
    ("stretch", "chunks"),
    [
        ((20, 25), (1, 3)),  # within one, and what may be written late
        ((19, 20), (0, 2)),
        ((0, 5), (0, 1)),  # before all: what is first may have been read late
        ((38, 90), (2, 4)),
        ((60, 90), (4, 4)),  # behind all
        ((0, 90), (0, 4)),
    ],
)
def test_a_stretch_is_of_whole_chunks(stretch: tuple[int, int], chunks: tuple[int, int]) -> None:
    index = index_of((10, 19), (20, 29), (30, 39), (40, 49))
    first, last = chunks
    assert index.stretch(*stretch, 5) == (1000 + 100 * first, 1000 + 100 * last)


def test_what_was_read_after_a_pause_is_within_the_stretch_it_is_stamped_in() -> None:
    index = index_of((10, 19), (20, 29), (3000, 3000), (3000, 3000), (3001, 3010))
    begin, end = index.stretch(100, 200, 5)  # ticks of these times have come at 3000
    assert (begin, end) == (1200, 1400)
