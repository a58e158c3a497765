"""Files whose descriptions contain each other, or are nested, so often that readers would fail."""

import struct
import time
import zlib
from pathlib import Path

import h5py
import pytest
from mcap.records import Schema

from extensions.importers.readers import progress
from extensions.importers.readers.mat import HEAD, loaded
from extensions.importers.readers.tables import WIDEST, Hdf5Table
from flight_log.payload_layout import SchemaLayouts
from quadrotor.errors import LogFormatError


def element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def cells(depth: int) -> bytes:
    """Return a cell in a cell in a cell, …, as MATLAB writes it."""
    found = b""
    for _ in range(depth):
        head = element(6, struct.pack("<II", 1, 0)) + element(5, struct.pack("<ii", 1, 1))
        found = element(14, head + element(1, b"") + found)
    return found


@pytest.mark.parametrize("is_packed", [False, True])
def test_matrices_that_are_nested_too_deep_are_refused_before_they_are_read(
    tmp_path: Path, is_packed: bool
) -> None:
    body = cells(3000)
    packed = zlib.compress(body)
    body = struct.pack("<II", 15, len(packed)) + packed if is_packed else body
    head = b"MATLAB 5.0 MAT-file".ljust(HEAD - 4) + b"\0\x01IM"
    (tmp_path / "deep.mat").write_bytes(head + body)
    with pytest.raises(LogFormatError, match=r"deep\.mat .*: it is nested too deep"):
        loaded(tmp_path / "deep.mat")


def test_a_chunk_of_hdf5_that_is_larger_than_memory_allows_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "chunk.hdf5"
    with h5py.File(path, "w") as file:
        rows = file.create_dataset(
            "ts", (100,), "f8", maxshape=(None,), chunks=(100_000_000,), compression="gzip"
        )
        rows[:1] = 0.0
    with pytest.raises(LogFormatError, match=r"chunk\.hdf5"):
        Hdf5Table(path).read("", ["ts"])


def test_a_matrix_with_more_columns_than_a_flight_has_is_no_table(tmp_path: Path) -> None:
    path = tmp_path / "wide.hdf5"
    with h5py.File(path, "w") as file:
        file.create_dataset("wide", (2, WIDEST), "u1")
        file.create_dataset("narrow", (2, 2), "u1")
    assert Hdf5Table(path).columns("") == ["narrow[0]", "narrow[1]"]


def test_a_message_that_contains_others_many_times_is_described_once() -> None:
    width, levels = 9, 12  # 9^12 by paths
    parts = ["\n".join(f"a/N{k + 1} f{j}" for j in range(width)) for k in range(levels)]
    text = parts[0] + "".join(
        f"\n{'=' * 80}\nMSG: a/N{k}\n{one}" for k, one in enumerate([*parts[1:], "float64 x"], 1)
    )
    layouts = SchemaLayouts(Schema(1, text.encode(), "ros2msg", "a/msg/N0"))
    with pytest.raises(LogFormatError, match="too few"):
        layouts.of(b"\0\1\0\0" + bytes(400))


def test_a_reader_ends_after_the_processor_time_of_any_file_of_its_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "LEAST_S", 0.01)
    path = tmp_path / "nested.csv"
    path.write_text("1")
    with pytest.raises(LogFormatError, match=r"nested\.csv takes more than 0 s"):
        work(path)


def work(path: Path) -> None:
    """Work for 20 s of processor time, as far as a file of this size may take it."""
    end = time.process_time() + 20.0
    with progress.bounded_time([path]):
        while time.process_time() < end:
            pass
