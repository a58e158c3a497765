"""Deletion of runs with undo: nothing is lost before its time, and nothing remains after it."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import select

from console.catalogue.catalogue import Catalogue
from console.catalogue.marks import marks_of, store_mark
from console.catalogue.notes import write_notes
from console.catalogue.tables import Mark, NoteRow, RunEntry, TagRow, TrashRow
from console.catalogue.tags import change_tags, tags_of
from console.parameters.station import RecorderParameters
from console.runs.adoption import tidy_runs
from console.runs.housekeeping import DAY, Housekeeping
from console.runs.report_folders import report_folder
from console.runs.run import RecorderStatus
from console.runs.storage import storage
from console.runs.trash import TRASH, delete_run, deleted_runs, purge, restore_run
from flight_log import LogWriter
from flight_log.columns.places import CACHES
from quadrotor.errors import RefusedError, StorageError
from tests.support.runs import run_entry
from vehicle_link.clock import host_time_ns

MB = 1_000_000


@pytest.fixture
def catalogue(tmp_path: Path) -> Catalogue:
    made = Catalogue(tmp_path)
    for i, name in enumerate(("r0", "r1", "r10")):
        log = made.folder / f"{name}.mcap"
        with LogWriter(log, {"vehicle": "quad1"}, {}) as writer:
            writer.write("/a", "std_msgs/String", bytes(100), 1, 1)
        made.add(run_entry(name, start_ns=1000 + i, duration=10.0, bytes=20 * MB, messages=1))
    report_folder(made.folder / "r1.mcap").mkdir()
    (report_folder(made.folder / "r1.mcap") / "result.json").write_text("{}")
    return made


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_undo_brings_back_file_report_notes_tags_and_marks(catalogue: Catalogue) -> None:
    before = names(catalogue.folder)
    write_notes(catalogue, "r1", "gusty", "anna")
    change_tags(catalogue, ["r1"], ["wind"], [])
    store_mark(catalogue, Mark("r1", "mark-0001", 5, 2.0, "door", "anna"))
    content = catalogue.resolve("r1").read_bytes()
    delete_run(catalogue, "r1", "anna")
    assert names(catalogue.folder) == before - {"r1.mcap", "r1_report"} | {TRASH}
    assert [(run.id, run.requester) for run in deleted_runs(catalogue)] == [("r1", "anna")]
    restore_run(catalogue, "r1")
    assert names(catalogue.folder) == before | {TRASH}
    assert catalogue.resolve("r1").read_bytes() == content
    assert catalogue.get("r1").notes == "gusty"
    assert tags_of(catalogue, ["r1"]) == {"r1": ["wind"]}
    assert [mark.text for mark in marks_of(catalogue, "r1")] == ["door"]
    assert deleted_runs(catalogue) == []


def test_a_run_being_recorded_is_not_deleted(catalogue: Catalogue) -> None:
    log = catalogue.folder / "now.mcap"
    with LogWriter(log, {}, {}):
        catalogue.add(RunEntry("now", "quad1", 5, 0.0, log.name, 0, 0, "ada", False, False, "", ""))
        with pytest.raises(RefusedError, match="now is being recorded; stop the recording"):
            delete_run(catalogue, "now", "anna")
        assert log.exists()
        assert deleted_runs(catalogue) == []


def test_only_what_is_asked_for_goes_and_only_once(catalogue: Catalogue) -> None:
    delete_run(catalogue, "r1", "anna")
    assert catalogue.resolve("r10").exists()
    with pytest.raises(StorageError, match="r1 was deleted"):
        delete_run(catalogue, "r1", "grace")
    with pytest.raises(StorageError, match="no run 'nope'"):
        delete_run(catalogue, "nope", "anna")
    with pytest.raises(StorageError, match="'r0' is not in the trash"):
        restore_run(catalogue, "r0")


def test_a_file_that_leads_elsewhere_is_not_moved(catalogue: Catalogue, tmp_path: Path) -> None:
    outside = tmp_path / "precious.mcap"
    outside.write_text("precious")
    catalogue.add(RunEntry("bad", "q", 1, 1.0, "../precious.mcap", 1, 1, "", True, False, "", ""))
    with pytest.raises(StorageError, match="is not inside"):
        delete_run(catalogue, "bad", "anna")
    assert outside.read_text() == "precious"


def test_undo_never_overwrites_a_file(catalogue: Catalogue) -> None:
    delete_run(catalogue, "r1", "anna")
    (catalogue.folder / "r1.mcap").write_text("somebody put this here")
    with pytest.raises(StorageError, match="exists already"):
        restore_run(catalogue, "r1")
    assert (catalogue.folder / "r1.mcap").read_text() == "somebody put this here"
    assert (catalogue.folder / TRASH / "r1_report").is_dir(), "all or nothing"
    assert [run.id for run in deleted_runs(catalogue)] == ["r1"]


def test_a_folder_that_cannot_take_the_file_leaves_the_run_listed(catalogue: Catalogue) -> None:
    (catalogue.folder / TRASH).write_text("a file in the way")
    with pytest.raises(StorageError, match="cannot move"):
        delete_run(catalogue, "r1", "anna")
    assert catalogue.resolve("r1").exists()


def test_after_its_time_nothing_of_a_run_is_left(catalogue: Catalogue) -> None:
    write_notes(catalogue, "r1", "gusty", "anna")
    change_tags(catalogue, ["r1"], ["wind"], [])
    store_mark(catalogue, Mark("r1", "mark-0001", 5, 2.0, "door", "anna"))
    (catalogue.folder / "r1.1.1.1.viser").write_text("made again when asked for")
    delete_run(catalogue, "r1", "anna")
    assert purge(catalogue, older_than=60.0).done == []
    assert (catalogue.folder / TRASH / "r1.mcap").exists()
    assert purge(catalogue).done == ["r1"]
    assert names(catalogue.folder) - {CACHES} == {"r0.mcap", "r10.mcap", TRASH}
    assert not (catalogue.folder / CACHES / "r1").exists()
    assert names(catalogue.folder / TRASH) == set()
    with catalogue.session() as session:
        assert session.get(RunEntry, "r1") is None
        for table in (TagRow, NoteRow, Mark, TrashRow):
            assert session.scalar(select(table).where(table.run_id == "r1")) is None
    assert catalogue.count() == 2


def test_a_crash_between_catalogue_and_file_undoes_the_deletion(catalogue: Catalogue) -> None:
    with catalogue.session() as session:
        session.add(TrashRow(run_id="r1", deleted_ns=time.time_ns(), requester="anna"))
    assert tidy_runs(catalogue) == ["run r1: its deletion was undone"]
    assert catalogue.resolve("r1").exists()


def test_tidying_leaves_the_trash_alone(catalogue: Catalogue) -> None:
    delete_run(catalogue, "r1", "anna")
    assert tidy_runs(catalogue) == []
    assert [run.id for run in deleted_runs(catalogue)] == ["r1"]


def test_the_gauge_counts_runs_and_trash_apart_and_knows_the_rate(catalogue: Catalogue) -> None:
    delete_run(catalogue, "r1", "anna")
    found = storage(catalogue)
    assert (found.runs, found.run_bytes) == (2, 40 * MB)
    assert (found.deleted, found.deleted_bytes) == (1, 20 * MB)
    assert found.rate == 2 * MB
    assert found.free > 0
    assert found.lasts(found.free - 10 * MB) == pytest.approx(5.0)
    assert found.lasts(found.free - 10 * MB, rate=MB) == pytest.approx(10.0)
    assert found.lasts(found.free + 1) == 0.0


def test_without_any_run_nobody_knows_how_long_recording_lasts(tmp_path: Path) -> None:
    assert storage(Catalogue(tmp_path)).lasts(0) is None


class House:
    """Housekeeping, and its messages."""

    def __init__(self, catalogue: Catalogue) -> None:
        self.said: list[str] = []
        self.alarms: dict[str, str | None] = {}
        self.parameters = RecorderParameters()
        status = RecorderStatus(False, "", 0.0, 0, 0, 0, ())
        self.keeping = Housekeeping(
            catalogue, self.parameters, lambda: status, self.said.append, self.alarms.__setitem__
        )


@pytest.fixture
def house(catalogue: Catalogue) -> House:
    return House(catalogue)


def test_the_trash_is_emptied_when_the_days_are_over(
    catalogue: Catalogue, house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    delete_run(catalogue, "r1", "anna")
    house.keeping.check()
    assert [run.id for run in deleted_runs(catalogue)] == ["r1"]
    later = round((house.parameters.trash_keep + 0.1) * DAY * 1e9)
    set_ns = time.time_ns() + later
    monkeypatch.setattr(time, "time_ns", lambda: set_ns)
    House(catalogue).keeping.check()
    assert [run.id for run in deleted_runs(catalogue)] == ["r1"], "the computer's clock was set"
    now_ns: Callable[[], int] = host_time_ns
    monkeypatch.setattr("console.runs.trash.host_time_ns", lambda: now_ns() + later)
    House(catalogue).keeping.check()
    assert deleted_runs(catalogue) == []


def test_a_disk_below_the_limit_is_an_alarm_that_says_how_long_it_lasts(house: House) -> None:
    house.parameters.warn_free = 10.0
    house.keeping.check()
    assert house.alarms["disk"] is None
    house.parameters.warn_free = 1_000_000.0
    house.keeping.check()
    assert "GB free, recording lasts" in str(house.alarms["disk"])
    assert "delete runs and empty the trash" in str(house.alarms["disk"])
