"""A recording that the disk has ended is started again as soon as the disk allows it."""

from __future__ import annotations

import shutil
from collections import namedtuple
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from console.alarms import Alarms
from console.catalogue.catalogue import Catalogue
from console.parameters.station import RecorderParameters
from console.parameters.store import StationStore
from console.runs.housekeeping import Housekeeping
from console.runs.run import RESTART_RESERVE
from console.runs.runs import RunManager
from flight_log import is_closed
from flight_log.run_folder import STATION
from quadrotor.errors import StorageError
from tests.waiting import until, wait_for

KEPT = 10_000_000
Usage = namedtuple("Usage", "total used free")


class Disk:
    """Disk with the free space that a test sets."""

    def __init__(self) -> None:
        self.free = 10**12
        self.asked = 0

    def usage(self, folder: Path) -> Usage:
        folder.stat()
        self.asked += 1
        return Usage(10**13, 0, self.free)

    def wait_asked(self, times: int) -> None:
        end = self.asked + times
        wait_for(lambda: self.asked >= end)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    made = Disk()
    monkeypatch.setattr("console.runs.disk.shutil", SimpleNamespace(disk_usage=made.usage))
    monkeypatch.setattr("console.runs.recorder.RESTART_PERIOD", 0.02)
    monkeypatch.setattr("console.runs.recorder.WATCH_PERIOD", 0.01)
    return made


@pytest.fixture
def catalogue(tmp_path: Path) -> Catalogue:
    return Catalogue(tmp_path / "data")


@pytest.fixture
def runs(disk: Disk, catalogue: Catalogue) -> Iterator[RunManager]:
    store = StationStore()
    store.preset({"station.recorder.keep_free": KEPT / 1e6, "station.recorder.after_disarm": 0.0})
    parameters: Any = SimpleNamespace(snapshot=lambda: ({}, 1, ""), defaults=dict)
    keeper = RunManager(catalogue, store, parameters, "quad1", "eva", lambda: b"{}")
    yield keeper
    keeper.close()


def begun(runs: RunManager, but: str = "") -> str:
    """Return the run that is being recorded, other than this one."""
    run_id = until(lambda: runs.recorder.run_id != but and runs.recorder.run_id)
    assert run_id
    return str(run_id)


def ended(runs: RunManager) -> str:
    """Return the alarm at the end."""
    wait_for(lambda: not runs.recorder.run_id)
    return until(lambda: "; ".join(runs.recorder.status().alarms))


def test_a_disk_full_in_flight_costs_what_was_flown_until_there_is_room_again(
    runs: RunManager, disk: Disk, catalogue: Catalogue
) -> None:
    runs.note_command("arm", "ada")
    runs.status(True, False)
    first = begun(runs)
    wait_for((catalogue.folder / first / STATION).exists)
    disk.free = KEPT - 1
    assert "only 9 MB are free" in ended(runs)
    assert "the next begins with 60 MB" in runs.recorder.status().alarms[0]
    disk.free = KEPT + RESTART_RESERVE - 1  # so little more would be used up at once
    disk.wait_asked(20)
    assert not runs.recorder.run_id
    assert "only 9 MB are free" in runs.recorder.status().alarms[0], "why it ended stays"
    disk.free = KEPT + RESTART_RESERVE
    second = begun(runs)
    assert (second != first, runs.recorder.status().alarms) == (True, ())
    runs.close()
    assert [is_closed(catalogue.folder / one / STATION) for one in (first, second)] == [True] * 2
    assert {entry.id: entry.operator for entry in map(catalogue.get, (first, second))} == {
        first: "ada",
        second: "ada",
    }
    assert {p.name for p in catalogue.folder.glob("[!.]*")} == {first, second}


def test_a_run_that_could_not_begin_at_arming_begins_when_there_is_room(
    runs: RunManager, disk: Disk
) -> None:
    disk.free = 0
    runs.status(True, False)
    assert "only 0 MB are free" in ended(runs)
    disk.free = 10**12
    begun(runs)
    assert runs.recorder.status().alarms == ()


def test_a_folder_that_vanishes_in_flight_is_made_again_and_recorded_into(
    runs: RunManager, catalogue: Catalogue
) -> None:
    runs.status(True, False)
    first = begun(runs)
    wait_for((catalogue.folder / first / STATION).exists)
    shutil.move(catalogue.folder, catalogue.folder.with_name("moved"))
    second = begun(runs, but=first)
    wait_for((catalogue.folder / second / STATION).exists)
    wait_for(lambda: runs.recorder.status().alarms == ())


def test_a_disk_that_tells_of_room_and_takes_nothing_begins_no_run(
    runs: RunManager, disk: Disk, catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[Path] = []

    def full(folder: Path) -> None:
        tried.append(folder)
        raise StorageError("Disk quota exceeded")

    with monkeypatch.context() as quota:
        quota.setattr("console.runs.recorder.try_disk", full)
        runs.status(True, False)
        first = begun(runs)
        wait_for((catalogue.folder / first / STATION).exists)
        disk.free = 0
        ended(runs)
        disk.free = 10**12
        wait_for(lambda: len(tried) >= 3)
        assert not runs.recorder.run_id
        assert [path.stem for path in catalogue.folder.glob("[!.]*")] == [first]
    begun(runs)


@pytest.mark.parametrize("how", ["disarmed", "by hand"])
def test_nothing_begins_again_that_was_ended_otherwise(
    runs: RunManager, disk: Disk, how: str
) -> None:
    runs.status(True, False)
    begun(runs)
    if how == "disarmed":
        disk.free = 0
        ended(runs)
        runs.status(False, False)
        disk.free = 10**12
    else:
        runs.by_hand(start=False, requester="ada")
    disk.wait_asked(30)
    assert runs.recorder.run_id == ""


def unmounted(folder: Path, disk: Path) -> None:
    """Make a folder that was moved away a link to a missing disk, whatever the recorder makes there
    meanwhile.
    """

    def linked() -> bool:
        with suppress(OSError):  # of the link: the recorder was faster
            with suppress(FileNotFoundError):
                folder.rmdir()
            folder.symlink_to(disk)
        return folder.is_symlink()

    wait_for(linked)


@pytest.mark.parametrize("which", ["data", "runs"])
def test_a_folder_that_is_away_is_one_alarm(
    runs: RunManager, catalogue: Catalogue, tmp_path: Path, which: str
) -> None:
    said: list[str] = []
    board = Alarms(said.append)
    keeping = Housekeeping(
        catalogue, RecorderParameters(), runs.recorder.status, lambda _: None, board.set
    )
    away = {"data": tmp_path / "data", "runs": catalogue.folder}[which]
    away.rename(tmp_path / "away")
    if which == "runs":
        unmounted(away, tmp_path / "not_mounted")
    wait_for(lambda: runs.recorder.status().alarms)
    keeping.check()
    [line] = board.lines(runs.recorder.status().alarms)
    reasons = {
        "data": f"the data folder is gone: {away}; nothing is recorded or saved; mount its disk or "
        "restore it, or restart quadlab to continue with what is there",
        "runs": f"the folder {away} cannot be reached (No such file or directory); is its disk "
        "mounted?",
    }
    assert line == reasons[which]
    assert said == [line]
    board.set("other", line)
    board.set("another", line)
    assert board.lines([line]) == [line]
    assert said == [line]
    if which == "runs":
        away.unlink()
    (tmp_path / "away").rename(away)
    wait_for(lambda: not runs.recorder.status().alarms)
