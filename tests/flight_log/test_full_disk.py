"""Disk full at any byte of a log: one clear line, and all before it stays readable."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from flight_log import LogWriter, is_closed, read_log, recover
from flight_log.file import LogFile
from quadrotor.errors import LogFormatError, StorageError

STRING = "std_msgs/String"
COUNT = 6


def write(path: Path) -> list[StorageError]:
    """Write a short recording in several chunks; return the errors raised."""
    said: list[StorageError] = []
    try:
        log = LogWriter(path, {"run_id": "r"}, {"a.json": b"[]"}, chunk_age_ns=2)
    except StorageError as error:
        return [error]
    try:
        for i in range(COUNT):
            log.write("/a", STRING, b"\0\1\0\0", i, i)
        log.flush()
    except StorageError as error:
        said.append(error)
        with pytest.raises(StorageError):  # it is over, and every call reports it
            log.write("/a", STRING, b"\0\1\0\0", 99, 99)
    try:
        whole = log.close()
    except StorageError as error:
        said.append(error)
        whole = False
    assert whole is (not said)
    return said


@pytest.fixture
def full_after(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Return a function that lets the process write only so many bytes more."""
    left, real = [0], os.write

    def limited(descriptor: int, data: bytes) -> int:
        if left[0] <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        written = real(descriptor, data[: left[0]])
        left[0] -= written
        return written

    def limit(count: int) -> None:
        left[0] = count
        monkeypatch.setattr("os.write", limited)

    return limit


def test_full_at_any_byte_it_is_said_once_and_what_was_written_is_kept(
    tmp_path: Path, full_after: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = tmp_path / "whole.mcap"
    assert write(whole) == []
    size = whole.stat().st_size
    expected = [m.log_ns for m in read_log(whole)]
    assert len(expected) == COUNT
    kept: list[int] = []
    for count in (*range(0, size, 13), size - 1):
        path = tmp_path / "full.mcap"
        full_after(count)
        [error] = write(path)
        monkeypatch.undo()
        assert "No space left on device" in str(error)
        if not path.exists():  # it held nothing of the run yet
            assert not kept
            continue
        assert path.stat().st_size == count
        assert not is_closed(path)
        try:
            assert recover(path).torn
        except LogFormatError:
            assert not kept
        else:
            found = [m.log_ns for m in read_log(path)]
            assert found == expected[: len(found)], f"full after {count} bytes"
            assert len(found) >= (kept[-1] if kept else 0)
            kept.append(len(found))
        path.unlink()
    assert set(kept) >= {0, COUNT}
    assert [p.name for p in tmp_path.iterdir()] == ["whole.mcap"]


def test_a_disk_without_room_for_the_copy_leaves_the_torn_log_as_it_was(
    tmp_path: Path, full_after: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "torn.mcap"
    write(path)
    torn = path.read_bytes()[:-30]
    for count in range(0, len(torn) // 2, 197):
        path.write_bytes(torn)
        full_after(count)
        with pytest.raises(StorageError, match="No space left on device"):
            recover(path)
        monkeypatch.undo()
        assert path.read_bytes() == torn
        assert [p.name for p in tmp_path.iterdir()] == ["torn.mcap"]


def test_two_who_mend_one_log_do_not_write_into_each_others_copy(tmp_path: Path) -> None:
    path = tmp_path / "torn.mcap"
    write(path)
    path.write_bytes(path.read_bytes()[:-30])
    other = LogFile(path.with_suffix(".recovering"), replace=True)
    other.write(b"half")
    with pytest.raises(StorageError, match="being written by another process"):
        recover(path)
    assert other.path.read_bytes() == b"half"
    other.close()  # as if it had been killed
    assert recover(path).messages == COUNT


def test_a_link_is_followed_to_the_log_it_leads_to(tmp_path: Path) -> None:
    path, link = tmp_path / "torn.mcap", tmp_path / "link.mcap"
    write(path)
    path.write_bytes(path.read_bytes()[:-30])
    link.symlink_to(path)
    assert recover(link).torn
    assert link.is_symlink()
    assert is_closed(path)
