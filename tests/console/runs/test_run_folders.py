"""A run is a folder: entered, repaired, moved and reported as a whole; single files stay runs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from console.catalogue.catalogue import Catalogue
from console.runs.adoption import tidy_runs
from console.runs.report_folders import report_folder
from console.runs.trash import delete_run, purge, restore_run
from flight_log import is_closed
from flight_log.columns.places import CACHES
from flight_log.merge import merge
from flight_log.run_folder import MERGED, STATION, VEHICLE, log_of, run_bytes
from tests.flight_log.drop_outs import Flight, flown, with_holes


@pytest.fixture
def catalogue(tmp_path: Path) -> Iterator[Catalogue]:
    made = Catalogue(tmp_path / "data")
    yield made
    made.close()


@pytest.fixture
def run(catalogue: Catalogue) -> Path:
    """Return a run with both logs, in no catalogue."""
    folder = catalogue.folder / "r1"
    flight = Flight(flown(300), with_holes(300, 3))
    flight.record(folder / STATION)
    flight.log_onboard(folder / VEHICLE)
    return folder


def test_a_folder_is_one_run_with_the_size_of_all_its_logs(catalogue: Catalogue, run: Path) -> None:
    merge(run)
    assert tidy_runs(catalogue) == ["run r1: entered in the catalogue"]
    entry = catalogue.get("r1")
    assert (entry.file, entry.bytes, entry.problem) == ("r1", run_bytes(run), "")
    assert catalogue.resolve("r1") == run.resolve()
    assert tidy_runs(catalogue) == []


def test_a_torn_recording_is_mended_in_its_folder(catalogue: Catalogue, run: Path) -> None:
    log = run / STATION
    log.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    [line] = tidy_runs(catalogue)
    assert "recovered" in line
    assert is_closed(log)
    assert catalogue.get("r1").recovered


def test_a_folder_without_the_station_s_log_shows_the_vehicle_s(
    catalogue: Catalogue, run: Path
) -> None:
    (run / STATION).unlink()
    [line] = tidy_runs(catalogue)
    assert f"{STATION} is missing" in line
    assert f"{STATION} is missing" in catalogue.get("r1").problem
    assert log_of(catalogue.resolve("r1")).name == VEHICLE
    assert tidy_runs(catalogue) == [], "told again at each start"


def test_a_folder_without_any_log_is_a_run_that_is_gone(catalogue: Catalogue, run: Path) -> None:
    tidy_runs(catalogue)
    for path in (run / STATION, run / VEHICLE):
        path.unlink()
    assert tidy_runs(catalogue) == ["run r1: the file is gone"]


def test_of_two_runs_of_one_name_the_folder_counts_and_the_file_is_left_alone(
    catalogue: Catalogue, run: Path
) -> None:
    other = run.with_suffix(".mcap")
    Flight(flown(50), np.ones(50, np.bool_)).record(other)
    before = other.read_bytes()
    told = tidy_runs(catalogue)
    assert told[0] == "run r1: entered in the catalogue"
    assert "r1.mcap" in told[1]
    assert len(told) == 2
    assert catalogue.get("r1").file == "r1"
    assert other.read_bytes() == before


def test_a_run_is_deleted_and_brought_back_with_all_that_is_in_its_folder(
    catalogue: Catalogue, run: Path
) -> None:
    merge(run)
    report_folder(run).mkdir()
    tidy_runs(catalogue)
    files = sorted(path.name for path in run.iterdir())
    assert files == [MERGED, "report", STATION, VEHICLE]
    delete_run(catalogue, "r1", "ada")
    assert not run.exists()
    assert tidy_runs(catalogue) == []
    restore_run(catalogue, "r1")
    assert sorted(path.name for path in run.iterdir()) == files
    delete_run(catalogue, "r1", "ada")
    assert purge(catalogue).done == ["r1"]
    assert {path.name for path in catalogue.folder.rglob("*")} <= {"trash", CACHES}
