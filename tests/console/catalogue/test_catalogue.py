"""Catalogue of runs: what is stored, what is found, and that no name leaves the folder."""

from __future__ import annotations

import os
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from console.catalogue.catalogue import Catalogue, run_name
from console.catalogue.notes import write_notes
from console.runs.adoption import tidy_runs
from flight_log import LogWriter, is_closed, read_log
from quadrotor.errors import StorageError
from tests.support.runs import run_entry


@pytest.fixture
def catalogue(tmp_path: Path) -> Catalogue:
    return Catalogue(tmp_path)


def write_log(path: Path, messages: int = 50, torn: bool = False) -> None:
    with LogWriter(path, {"vehicle": "quad1", "operator": "ada"}, {}) as log:
        for i in range(messages):
            log.write("/a", "std_msgs/String", bytes(100), i * 50_000_000, i)
    if torn:
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def test_a_run_comes_back_as_it_was_entered(catalogue: Catalogue) -> None:
    catalogue.add(run_entry("r1"))
    assert catalogue.get("r1") == run_entry("r1")
    assert catalogue.get("r1").start.year == 2023


def test_runs_are_listed_newest_first_and_by_page(catalogue: Catalogue) -> None:
    for i in range(5):
        catalogue.add(run_entry(f"r{i}", start_ns=i))
    assert [e.id for e in catalogue.runs()] == ["r4", "r3", "r2", "r1", "r0"]
    assert [e.id for e in catalogue.runs(limit=2, offset=1)] == ["r3", "r2"]
    assert catalogue.count() == 5


def test_search_looks_in_id_operator_and_notes_and_takes_percent_literally(
    catalogue: Catalogue,
) -> None:
    catalogue.add(run_entry("alpha", operator="Grace"))
    catalogue.add(run_entry("beta"))
    write_notes(catalogue, "beta", "payload 100% ok")
    assert [e.id for e in catalogue.runs(search="ALPHA")] == ["alpha"]
    assert [e.id for e in catalogue.runs(search="grace")] == ["alpha"]
    assert [e.id for e in catalogue.runs(search="100%")] == ["beta"]
    assert catalogue.runs(search="%") == catalogue.runs(search="100%")
    assert catalogue.runs(vehicle="quad2") == []


def test_new_facts_about_a_run_keep_its_notes(catalogue: Catalogue) -> None:
    catalogue.add(run_entry("r1", complete=False))
    write_notes(catalogue, "r1", "gusty")
    catalogue.add(run_entry("r1", duration=9.0))
    assert catalogue.get("r1").notes == "gusty"
    assert catalogue.get("r1").duration == 9.0


def test_an_unknown_run_is_one_clear_line(catalogue: Catalogue) -> None:
    for act in (catalogue.get, catalogue.resolve, catalogue.remove):
        with pytest.raises(StorageError, match="no run 'nope'"):
            act("nope")


def test_a_second_process_sees_what_the_first_wrote(tmp_path: Path, catalogue: Catalogue) -> None:
    other = Catalogue(tmp_path)
    catalogue.add(run_entry("r1"))
    write_notes(other, "r1", "from the page")
    assert catalogue.get("r1").notes == "from the page"
    other.close()


def test_resolve_gives_the_file_of_a_catalogued_run(tmp_path: Path, catalogue: Catalogue) -> None:
    write_log(tmp_path / "runs" / "r1.mcap")
    catalogue.add(run_entry("r1"))
    assert catalogue.resolve("r1") == (tmp_path / "runs" / "r1.mcap").resolve()


@pytest.mark.parametrize("name", ["../secret", "..", "/etc/passwd", "a/b", "", "r1.mcap", "r1\0"])
def test_a_name_that_is_no_run_resolves_to_nothing(
    tmp_path: Path, catalogue: Catalogue, name: str
) -> None:
    (tmp_path / "secret.mcap").write_text("x")
    with pytest.raises(StorageError):
        catalogue.resolve(name)


def test_not_even_a_catalogued_name_leaves_the_folder(tmp_path: Path, catalogue: Catalogue) -> None:
    (tmp_path / "secret.mcap").write_text("x")
    (tmp_path / "runs" / "link.mcap").symlink_to(tmp_path / "secret.mcap")
    (tmp_path / "runs" / "notes.txt").write_text("x")
    for name, file in (("up", "../secret.mcap"), ("link", "link.mcap"), ("text", "notes.txt")):
        catalogue.add(run_entry(name, file=file))
        with pytest.raises(StorageError, match="is not inside"):
            catalogue.resolve(name)


def test_a_run_whose_file_is_gone_says_so(catalogue: Catalogue) -> None:
    catalogue.add(run_entry("r1"))
    with pytest.raises(StorageError, match="gone"):
        catalogue.resolve("r1")


def test_a_broken_database_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "catalogue.sqlite").write_bytes(b"this is no database" * 100)
    with pytest.raises(StorageError, match="logs themselves are not touched"):
        Catalogue(tmp_path)


def test_run_names_are_utc_stamps_and_never_taken_twice(tmp_path: Path) -> None:
    now = datetime(2026, 1, 31, 9, 30, 42, tzinfo=UTC)
    assert run_name(now, "quad1", tmp_path) == "20260131T093042Z_quad1"
    (tmp_path / "20260131T093042Z_quad1.mcap").write_text("")
    assert run_name(now, "quad1", tmp_path) == "20260131T093042Z_quad1_2"
    taken = {"20260131T093042Z_quad1_2"}
    assert run_name(now, "quad1", tmp_path, taken) == "20260131T093042Z_quad1_3"


def test_torn_files_are_recovered_and_marked(tmp_path: Path, catalogue: Catalogue) -> None:
    path = tmp_path / "runs" / "torn.mcap"
    write_log(path, torn=True)
    catalogue.add(run_entry("torn", complete=False, operator="ada", messages=0))
    write_notes(catalogue, "torn", "crashed")
    [line] = tidy_runs(catalogue)
    assert "recovered" in line
    after = catalogue.get("torn")
    assert after.recovered
    assert after.complete
    assert after.notes == "crashed"
    assert after.messages == len(list(read_log(path))) > 0
    assert is_closed(path)
    assert tidy_runs(catalogue) == []


def test_files_the_catalogue_does_not_know_are_entered(
    tmp_path: Path, catalogue: Catalogue
) -> None:
    write_log(tmp_path / "runs" / "found.mcap")
    tidy_runs(catalogue)
    found = catalogue.get("found")
    assert (found.complete, found.recovered, found.vehicle) == (True, False, "quad1")
    assert found.messages == 50


def test_a_run_of_simulated_time_is_listed_at_the_time_of_its_file(
    tmp_path: Path, catalogue: Catalogue
) -> None:
    path = tmp_path / "runs" / "figure_eight_seed1.mcap"
    write_log(path)  # 50 messages, one each 50 ms from 0 on
    written = datetime(2026, 5, 4, 13, 40, tzinfo=UTC)
    os.utime(path, (written.timestamp(), written.timestamp()))
    tidy_runs(catalogue)
    found = catalogue.get(path.stem)
    assert found.duration == pytest.approx(2.45)
    assert found.start == written - timedelta(seconds=found.duration)


def test_what_cannot_be_read_is_said_and_kept(tmp_path: Path, catalogue: Catalogue) -> None:
    (tmp_path / "runs" / "empty.mcap").write_bytes(b"")
    catalogue.add(run_entry("lost"))
    lines = tidy_runs(catalogue)
    assert len(lines) == 2
    assert "nothing was recorded" in catalogue.get("empty").problem
    assert catalogue.get("lost").problem == "the file is gone"
    assert (tmp_path / "runs" / "empty.mcap").exists()


def test_a_run_being_recorded_is_left_alone(tmp_path: Path, catalogue: Catalogue) -> None:
    path = tmp_path / "runs" / "now.mcap"
    log = LogWriter(path, {}, {})
    log.write("/a", "std_msgs/String", bytes(100), 0, 0)
    before = path.read_bytes()
    assert tidy_runs(catalogue) == []
    assert path.read_bytes() == before
    log.close()
