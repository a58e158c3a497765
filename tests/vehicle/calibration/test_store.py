"""The vehicle's calibrations on disk: complete, in order, and not lost to a damaged line."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from quadrotor.calibration_record import CalibrationRecord
from quadrotor.errors import StorageError
from quadrotor.parameter_description import ParameterValue
from vehicle.calibration.store import (
    AT_START,
    FOLDER,
    HISTORY,
    ON_REQUEST,
    SET_ASIDE,
    CalibrationStore,
)

NS = 1_780_000_000_000_000_000
Values = dict[str, ParameterValue]


def record(name: str, second: int, values: Values | None = None) -> CalibrationRecord:
    return CalibrationRecord(
        name=name, values=values or {}, requester="anna", stamp_ns=NS + second * 10**9
    )


MASS, LATER = record("mass", 1, {"model.mass": 1.31}), record("mass", 3, {"model.mass": 1.35})
MOTOR = record("motor", 2, {"model.motor_offset": 14.5})


class Disk:
    """Data folder, and the events of a store."""

    def __init__(self, data: Path) -> None:
        self.data = data
        self.said: list[str] = []
        self.history, self.set_aside = data / FOLDER / HISTORY, data / FOLDER / SET_ASIDE

    def open(self) -> CalibrationStore:
        return CalibrationStore(self.data, self.said.append)


@pytest.fixture
def disk(tmp_path: Path) -> Disk:
    return Disk(tmp_path)


def test_what_was_stored_is_there_again_and_the_newest_of_a_name_counts(disk: Disk) -> None:
    store = disk.open()
    for one in (MASS, MOTOR, LATER):
        store.append(one)
    for again in (store, disk.open()):
        assert again.newest_first() == [LATER, MOTOR, MASS]
        assert again.newest() == [MOTOR, LATER]
    assert disk.said == []


def test_a_clock_that_was_wrong_does_not_bring_an_older_one_back(disk: Disk) -> None:
    store = disk.open()
    store.append(LATER)
    store.append(MASS)  # stamped earlier
    assert disk.open().newest() == [MASS]


def test_a_torn_line_is_set_aside_told_and_what_comes_next_is_whole(disk: Disk) -> None:
    disk.open().append(MASS)
    whole = disk.history.read_bytes()
    disk.history.write_bytes(whole + whole[: len(whole) // 2])
    store = disk.open()
    assert store.newest_first() == [MASS]
    (line,) = disk.said
    assert "held a line that cannot be used (not a calibration record" in line
    assert "\n" not in line
    assert disk.set_aside.read_bytes() == whole[: len(whole) // 2] + b"\n"
    store.append(MOTOR)
    assert disk.open().newest_first() == [MOTOR, MASS]
    assert len(disk.said) == 1, "told once, for it is gone from the history"


def test_foreign_lines_are_kept_beside_it_byte_for_byte(disk: Disk) -> None:
    disk.open().append(MASS)
    foreign = [b"<html>", b'{"name": "mass", "mass": 2}', b"\xff\xfe\x00", b'["a", 1]', b"7"]
    disk.history.write_bytes(b"\n".join([*foreign, disk.history.read_bytes()]))
    assert disk.open().newest_first() == [MASS]
    assert disk.set_aside.read_bytes().splitlines() == foreign
    (line,) = disk.said
    assert "held 5 lines that cannot be used" in line


def test_lines_that_cannot_be_moved_stay_and_the_others_count(disk: Disk) -> None:
    disk.open().append(MASS)
    before = disk.history.read_bytes() + b"<html>\n"
    disk.history.write_bytes(before)
    disk.set_aside.symlink_to("/dev/full")
    assert disk.open().newest_first() == [MASS]
    (line,) = disk.said
    assert "left there: No space left on device" in line
    assert disk.history.read_bytes() == before


def test_a_full_disk_is_a_reason_and_nothing_is_stored(disk: Disk) -> None:
    store = disk.open()
    disk.history.parent.mkdir()
    disk.history.symlink_to("/dev/full")
    with pytest.raises(
        StorageError, match=r"not stored .*: No space left on device; free some space"
    ):
        store.append(MASS)
    assert store.newest_first() == []
    disk.history.unlink()
    store.append(MASS)
    assert disk.open().newest_first() == [MASS]


@pytest.mark.parametrize("call", ["write", "fsync"])
def test_a_disk_that_fills_within_a_line_leaves_none_of_it(
    disk: Disk, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    store = disk.open()
    store.append(MASS)
    before = disk.history.read_bytes()
    write = os.write

    def half(descriptor: int, data: bytes) -> int:
        write(descriptor, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    def fail(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, call, half if call == "write" else fail)
    with pytest.raises(StorageError, match="No space left"):
        store.append(MOTOR)
    monkeypatch.undo()
    assert disk.history.read_bytes() == before
    assert store.newest_first() == disk.open().newest_first() == [MASS]


def test_a_line_torn_off_elsewhere_is_not_glued_to_the_next(disk: Disk) -> None:
    store = disk.open()
    store.append(MASS)
    with disk.history.open("ab") as file:
        file.write(b'{"name": "mo')
    store.append(MOTOR)
    assert disk.open().newest_first() == [MOTOR, MASS]


def test_a_history_that_cannot_be_read_is_told_and_never_written_over(disk: Disk) -> None:
    disk.history.mkdir(parents=True)
    store = disk.open()
    (line,) = disk.said
    assert "cannot be read: Is a directory; calibrations in it are not in force" in line
    assert store.newest() == []
    with pytest.raises(StorageError, match=r"not stored: .* cannot be read"):
        store.append(MASS)


def test_what_is_found_at_each_start_does_not_grow(disk: Disk) -> None:
    store = disk.open()
    store.append(MASS)
    for second in (5, 6, 7):
        store.replace(AT_START, record("gyroscope", second))
    assert len((disk.data / FOLDER / AT_START).read_bytes().splitlines()) == 1
    store.append(record("gyroscope", 9))
    for again in (store, disk.open()):
        stamps = [(one.stamp_ns - NS) // 10**9 for one in again.newest_first()]
        assert stamps == [9, 7, 1]
        assert again.newest()[-1].stamp_ns == NS + 9 * 10**9


def test_what_was_found_on_request_counts_but_is_no_history(disk: Disk) -> None:
    store = disk.open()
    store.replace(AT_START, record("gyroscope", 5))
    for second in (6, 7):
        store.replace(ON_REQUEST, record("gyroscope", second))
    for again in (store, disk.open()):
        assert again.newest() == [record("gyroscope", 7)]
        assert again.newest_first() == [record("gyroscope", 5)]


def test_a_record_beyond_all_bounds_is_none(disk: Disk) -> None:
    line = CalibrationRecord(name="mass", conditions={"a": "b" * 40_000}).model_dump_json()
    disk.history.parent.mkdir()
    disk.history.write_text(line + "\n")
    assert disk.open().newest() == []
    assert "bytes long, at most 32000" in disk.said[0]
