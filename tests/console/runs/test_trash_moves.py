"""A deletion interrupted by a crash or a concurrent scan; a trash that cannot be emptied."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from console.catalogue.notes import write_notes
from console.catalogue.tables import RunEntry
from console.parameters.station import RecorderParameters
from console.runs import trash as run_trash
from console.runs.adoption import tidy_runs
from console.runs.housekeeping import Housekeeping
from console.runs.report_folders import report_folder
from console.runs.run import RecorderStatus
from console.runs.storage import storage
from console.runs.trash import TRASH, delete_run, deleted_runs, purge, restore_run
from flight_log import LogWriter
from flight_log.columns.places import CACHES

LIMIT = 10.0


@pytest.fixture
def catalogue(tmp_path: Path) -> Catalogue:
    made = Catalogue(tmp_path)
    for name in ("r1", "r2", "r3"):
        log = made.folder / f"{name}.mcap"
        with LogWriter(log, {"vehicle": "quad1"}, {}) as writer:
            writer.write("/a", "std_msgs/String", bytes(100), 1, 1)
        made.add(RunEntry(name, "quad1", 5, 10.0, log.name, 9, 1, "ada", True, False, "", ""))
        report_folder(log).mkdir()
        (report_folder(log) / "result.json").write_text("{}")
    return made


def in_trash(catalogue: Catalogue) -> set[str]:
    return {path.name for path in (catalogue.folder / TRASH).iterdir()}


def cannot_remove(catalogue: Catalogue, name: str) -> None:
    """Put a link in the report's place: a folder is not removed through one."""
    report = catalogue.folder / TRASH / f"{name}_report"
    elsewhere = catalogue.folder.parent / f"report of {name}"
    report.rename(elsewhere)
    report.symlink_to(elsewhere)


# ---------------------------------------------------------------------- emptying
def test_what_cannot_be_removed_is_told_and_the_rest_goes(catalogue: Catalogue) -> None:
    for name in ("r1", "r2", "r3"):
        delete_run(catalogue, name, "anna")
    for name in ("r3", "r1"):
        cannot_remove(catalogue, name)
    purged = purge(catalogue)
    assert purged.done == ["r2"]
    assert set(purged.refused) == {"r1", "r3"}
    for name, reason in purged.refused.items():
        assert reason.startswith(f"run {name} cannot be removed from ")
        assert "\n" not in reason
    assert {run.id for run in deleted_runs(catalogue)} == {"r1", "r3"}


def test_a_run_that_could_not_be_removed_whole_can_be_put_back(catalogue: Catalogue) -> None:
    delete_run(catalogue, "r1", "anna")
    cannot_remove(catalogue, "r1")
    assert purge(catalogue).done == []
    restore_run(catalogue, "r1")
    assert catalogue.resolve("r1").exists()


def test_a_trash_that_cannot_be_emptied_is_an_alarm_until_it_can(
    catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    alarms: dict[str, str | None] = {}
    status = RecorderStatus(False, "", 0.0, 0, 0, 0, ())
    parameters = RecorderParameters()
    keeping = Housekeeping(catalogue, parameters, lambda: status, said.append, alarms.__setitem__)
    monkeypatch.setattr("console.runs.housekeeping.DAY", 0.0)
    monkeypatch.setattr("console.runs.housekeeping.RETRY", 0.0)
    for name in ("r1", "r2"):
        delete_run(catalogue, name, "anna")
    cannot_remove(catalogue, "r2")
    keeping.check()
    assert [line.split(":")[0] for line in said] == ["run r1"]
    assert "run r2 cannot be removed" in str(alarms["trash"])
    (catalogue.folder / TRASH / "r2_report").unlink()
    keeping.check()
    assert alarms["trash"] is None
    assert deleted_runs(catalogue) == []


# ---------------------------------------------------------------------- half way
class Paused:
    """Thread that stops before its line in the catalogue is written."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, step: str, act: Callable[[], None]) -> None:
        self.reached, self.go_on = threading.Event(), threading.Event()
        real = getattr(run_trash, step)

        def slow(*arguments: Any) -> None:
            if threading.current_thread() is self.thread:
                self.reached.set()
                assert self.go_on.wait(LIMIT)
            real(*arguments)

        monkeypatch.setattr(run_trash, step, slow)
        self.thread = threading.Thread(target=act)
        self.thread.start()
        assert self.reached.wait(LIMIT)

    def finish(self) -> None:
        self.go_on.set()
        self.thread.join(LIMIT)
        assert not self.thread.is_alive()


def test_a_scan_in_the_middle_of_a_deletion_changes_nothing_of_it(
    catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_notes(catalogue, "r1", "gusty", "anna")
    step = "_out_of_the_list"
    deleting = Paused(monkeypatch, step, lambda: delete_run(catalogue, "r1", "anna"))
    tidy_runs(catalogue)
    deleting.finish()
    assert [(run.id, run.requester) for run in deleted_runs(catalogue)] == [("r1", "anna")]
    assert in_trash(catalogue) == {"r1.mcap", "r1_report"}
    restore_run(catalogue, "r1")
    entry = catalogue.get("r1")
    assert (entry.problem, entry.complete, entry.notes) == ("", True, "gusty")


def test_a_deletion_after_the_scan_has_begun_is_no_missing_file(
    catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scan has read the list; then the file is moved."""
    real = catalogue.runs
    paused: list[Paused] = []

    def listed(*arguments: Any, **options: Any) -> list[RunEntry]:
        found = real(*arguments, **options)
        step = "_out_of_the_list"
        paused.append(Paused(monkeypatch, step, lambda: delete_run(catalogue, "r1", "anna")))
        return found

    monkeypatch.setattr(catalogue, "runs", listed)
    assert tidy_runs(catalogue) == []
    paused[0].finish()
    restore_run(catalogue, "r1")
    assert catalogue.get("r1").problem == ""


def test_a_scan_in_the_middle_of_an_undo_changes_nothing_of_it(
    catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    delete_run(catalogue, "r1", "anna")
    undoing = Paused(monkeypatch, "_back_in_the_list", lambda: restore_run(catalogue, "r1"))
    tidy_runs(catalogue)
    undoing.finish()
    assert catalogue.resolve("r1").exists()
    assert report_folder(catalogue.resolve("r1")).is_dir()
    assert deleted_runs(catalogue) == []


@pytest.mark.parametrize("moved", [("r1.mcap",), ("r1.mcap", "r1_report")])
def test_a_deletion_that_a_crash_cut_off_is_finished_at_the_start(
    catalogue: Catalogue, moved: tuple[str, ...]
) -> None:
    (catalogue.folder / TRASH).mkdir()
    for name in moved:
        (catalogue.folder / name).rename(catalogue.folder / TRASH / name)
    assert tidy_runs(catalogue) == ["run r1: its deletion was finished"]
    assert [run.id for run in deleted_runs(catalogue)] == ["r1"]
    assert in_trash(catalogue) == {"r1.mcap", "r1_report"}
    restore_run(catalogue, "r1")
    assert catalogue.get("r1").problem == ""


def test_an_undo_that_a_crash_cut_off_is_finished_at_the_start(catalogue: Catalogue) -> None:
    delete_run(catalogue, "r1", "anna")
    (catalogue.folder / TRASH / "r1.mcap").rename(catalogue.folder / "r1.mcap")
    assert tidy_runs(catalogue) == ["run r1: its deletion was undone"]
    assert report_folder(catalogue.resolve("r1")).is_dir()
    assert in_trash(catalogue) == set()


# ---------------------------------------------------------------------- prepared replays
def test_the_gauge_counts_prepared_replays_and_they_go_with_their_run(catalogue: Catalogue) -> None:
    for name, size in (("r1", 300), ("r2", 50), ("r3.new/scratch", 7)):
        place = catalogue.folder / CACHES / name
        place.mkdir(parents=True)
        (place / "columns").write_bytes(bytes(size))
    assert storage(catalogue).replay_bytes == 357
    delete_run(catalogue, "r1", "anna")
    assert storage(catalogue).replay_bytes == 57
    assert not (catalogue.folder / CACHES / "r1").exists()
