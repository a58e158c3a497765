"""Ring of onboard logs: which are deleted, in which order, and which never."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from quadrotor.errors import StorageError
from vehicle.onboard_log.parameters import OnboardLogParameters, log_parameters
from vehicle.onboard_log.ring import CLOCK_SET_S, FETCHED_S, Fetched, Ring

NOW = 1_780_000_000.0
DAY = 86_400.0
GB = 10**9
KEEP = OnboardLogParameters(keep_days=30.0, keep_size=4.0, keep_free=1000.0, stop_free=500.0)


class Folder:
    """Logs of 1 GB (sparse), the oldest first, on a disk of 100 GB."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.time = 0.0
        self.fetched = Fetched(lambda: self.time)
        self.clock_right = True
        self.others = 0
        self.ring = Ring(path, self.fetched, self._free, lambda: NOW, lambda: self.clock_right)

    def _free(self, folder: Path) -> int:
        return 100 * GB - self.others - GB * len(self.names())

    def add(self, name: str, days: float, *, closed: bool = True) -> Path:
        path = self.path / f"{name}.mcap"
        path.parent.mkdir(exist_ok=True)
        with path.open("wb") as stream:
            stream.seek(GB - 8)
            stream.write(b"\x89MCAP0\r\n" if closed else b"\0" * 8)
        os.utime(path, (NOW - DAY * days,) * 2)
        return path

    def names(self) -> list[str]:
        return sorted(path.stem for path in self.path.glob("*.mcap"))

    def tidy(self) -> list[str]:
        return list(self.ring.tidy(KEEP))


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    return Folder(tmp_path / "onboard")


def test_what_is_within_all_bounds_stays(folder: Folder) -> None:
    assert folder.tidy() == [], "nor is anything said of no folder"
    for days in (1, 2, 29):
        folder.add(f"day{days}", days)
    assert folder.tidy() == []
    assert folder.names() == ["day1", "day2", "day29"]


def test_logs_that_are_too_old_go_one_line_each(folder: Folder) -> None:
    for days in (1, 31, 40):
        folder.add(f"day{days}", days)
    assert folder.tidy() == [
        "onboard log day40.mcap (1.0 GB) removed: 40 days old, log.keep_days is 30",
        "onboard log day31.mcap (1.0 GB) removed: 31 days old, log.keep_days is 30",
    ]
    assert folder.names() == ["day1"]


def test_the_oldest_go_until_all_together_fit(folder: Folder) -> None:
    for days in range(1, 8):
        folder.add(f"day{days}", days)
    lines = folder.tidy()
    assert [line.split()[2] for line in lines] == ["day7.mcap", "day6.mcap", "day5.mcap"]
    assert "all are 7.0 GB, log.keep_size is 4.0 GB" in lines[0]
    assert folder.names() == ["day1", "day2", "day3", "day4"]


def test_the_oldest_go_until_the_disk_has_room(folder: Folder) -> None:
    for days in (1, 2, 3):
        folder.add(f"day{days}", days)
    folder.others = 97 * GB
    (line,) = folder.tidy()
    assert "day3.mcap" in line
    assert "removed: 0.0 MB free, log.keep_free is 1.0 GB" in line


def test_the_newest_never_goes(folder: Folder) -> None:
    for days in (100, 200):
        folder.add(f"day{days}", days)
    folder.others = 99 * GB
    folder.tidy()
    assert folder.names() == ["day100"]


def test_a_log_that_is_not_closed_never_goes(folder: Folder) -> None:
    folder.add("torn", 90, closed=False)
    folder.add("old", 80)
    folder.add("new", 1)
    folder.tidy()
    assert folder.names() == ["new", "torn"]


def test_a_log_that_is_being_fetched_stays_until_nobody_reads_it(folder: Folder) -> None:
    for days in (1, 40, 50):
        folder.add(f"day{days}", days)
    folder.fetched.note("day50.mcap")
    folder.time = FETCHED_S - 1.0
    folder.tidy()
    assert folder.names() == ["day1", "day50"]
    folder.time = FETCHED_S + 1.0
    folder.tidy()
    assert folder.names() == ["day1"]


def test_nothing_is_too_old_by_a_clock_that_is_not_right(folder: Folder) -> None:
    folder.add("old", 300)
    unset = folder.add("unset", 0)
    os.utime(unset, (CLOCK_SET_S - 1e9,) * 2)
    folder.add("new", 1)
    folder.clock_right = False
    assert folder.tidy() == []
    folder.clock_right = True
    (line,) = folder.tidy()
    assert "old.mcap" in line
    assert folder.names() == ["new", "unset"]


def test_a_log_that_cannot_be_removed_is_said(
    folder: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    for days in (1, 40):
        folder.add(f"day{days}", days)

    def refuse(path: Path) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(Path, "unlink", refuse)
    with pytest.raises(StorageError, match=r"cannot tidy .*: Operation not permitted"):
        folder.tidy()


def test_the_parameters_are_found_among_all_of_the_vehicle() -> None:
    values = OnboardLogParameters(keep_days=3.0).model_dump()
    given = {f"log.{name}": value for name, value in values.items()} | {"model.mass": 1.3}
    assert log_parameters(given).keep_days == 3.0
    assert log_parameters(given).stop_bytes == 500_000_000
