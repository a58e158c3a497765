"""Campaigns over recorded flights, and the trends of their figures."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from benchmarks.logs.recorded_run import MadeRun, write_run
from console.catalogue.catalogue import Catalogue
from console.catalogue.search import RunSearch
from console.catalogue.tags import change_tags
from console.runs.adoption import described
from extensions.campaigns.again import fly_again
from extensions.campaigns.plan import parse_plan
from extensions.campaigns.recorded.trends import DAY, RunFigures, recorded, trends
from extensions.campaigns.tests.conftest import Bench
from quadrotor.errors import UsageError

EXPLAIN = 'experiment = "explanation"\nlogs = "runs/*"\n'


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("made") / "a.mcap", MadeRun(2.0))


def recorded_as(log: Path, bench: Bench, *names: str) -> None:
    for name in names:
        (bench.folder / "runs").mkdir(exist_ok=True)
        shutil.copy(log, bench.folder / "runs" / f"{name}.mcap")


def test_logs_are_rows_and_later_logs_are_further_rows(bench: Bench, log: Path) -> None:
    recorded_as(log, bench, "b", "c")
    (bench.folder / "runs" / "notes.txt").write_text("no log")
    first = bench.flown(EXPLAIN, "campaigns/health").table()
    recorded_as(log, bench, "a")
    both = bench.flown(EXPLAIN, "campaigns/health").table()
    names = [Path(one).stem for one in both["log"].to_pylist()]
    assert names == ["b", "c", "a"]
    assert first["log"].to_pylist() == both["log"].to_pylist()[:2]
    assert set(both["verdict"].to_pylist()) == {"passed"}, both["reason"].to_pylist()
    assert len(set(both["duration_s"].to_pylist())) == 1
    said = bench.quadlab("show", bench.folder / "campaigns/health", "--json")[1]
    assert '"flights": 3' in said


def test_a_log_that_cannot_be_read_is_a_row_with_its_reason(bench: Bench) -> None:
    (bench.folder / "runs").mkdir()
    (bench.folder / "runs" / "a.mcap").write_bytes(b"no log at all")
    flown = bench.flown(EXPLAIN, "out")
    (row,) = flown.table().to_pylist()
    assert row["verdict"] == "raised"
    assert "a.mcap" in row["reason"]
    said = bench.quadlab("show", flown.path)[1]
    assert f"quadlab log info --explain {bench.folder}/runs/a.mcap" in said


@pytest.mark.parametrize(
    ("plan", "said"),
    [
        ('experiment = "explanation"\n', 'experiment = "explanation" needs logs'),
        ('experiment = "hover"\nlogs = "*"\n', 'must be "explanation" or "replay"'),
        (EXPLAIN + 'board = "crazyflie"\n', "a recorded flight has no board"),
        (EXPLAIN + "seeds = 3\n", "seeds = 1"),
        (EXPLAIN + '[fixed]\n"simulator.drag" = 0.1\n', "an explanation has no parameters"),
        (EXPLAIN, r"nothing in .* matches 'runs/\*'"),
        ('experiment = "replay"\nlogs = "runs/*"\n[factors]\nlog = [1]\n', "factors.log"),
    ],
)
def test_plans_that_recorded_flights_do_not_fit_are_refused(
    tmp_path: Path, plan: str, said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        parse_plan(plan, tmp_path / "plan.toml")


def test_the_settings_of_a_replay_are_checked_before_the_first_row(bench: Bench, log: Path) -> None:
    recorded_as(log, bench, "a")
    plan = 'experiment = "replay"\nlogs = "runs/*"\n[factors]\n"estimation.estimatr" = ["a"]\n'
    assert "estimation.estimatr" in bench.refused("check", bench.plan(plan))


def runs(values: list[float], tags: tuple[str, ...] = (), vehicle: str = "quad1") -> Any:
    return [
        RunFigures(f"{vehicle}_{k}", k * DAY, vehicle, tags, {"sag_v": value})
        for k, value in enumerate(values)
    ]


def test_a_trend_has_its_slope_a_day_and_single_outliers_do_not_turn_it() -> None:
    found = trends(runs([1.0, 1.1, 1.2, 9.0, 1.4, 1.5, 1.6]), "sag_v", "all")
    (series,) = found["series"]
    assert series["slope"] == pytest.approx(0.1)
    assert series["interval"][0] <= 0.1 <= series["interval"][1]
    assert [one["number"] for one in series["points"]] == [1, 2, 3, 4, 5, 6, 7]


def test_trends_are_of_vehicles_packs_or_tags() -> None:
    both = runs([1.0], ("battery 1", "windy")) + runs([2.0, 3.0], ("Battery 2",), "quad2")
    names = {
        by: [one["name"] for one in trends(both, "sag_v", by)["series"]]
        for by in ("vehicle", "battery", "tag")
    }
    assert names == {
        "vehicle": ["quad1", "quad2"],
        "battery": ["Battery 2", "battery 1"],
        "tag": ["Battery 2", "battery 1", "windy"],
    }
    assert trends(both, "sag_v", "all")["series"][0]["slope"] is None  # of three runs


def test_trends_have_reports_and_campaigns_over_the_runs(bench: Bench, log: Path) -> None:
    recorded_as(log, bench, "a")
    bench.flown(EXPLAIN, "campaigns/health")
    catalogue = Catalogue(bench.folder)
    try:
        catalogue.add(described(bench.folder / "runs" / "a.mcap", None))
        change_tags(catalogue, ["a"], ["battery 3"], [])
        (found,) = recorded(catalogue, RunSearch(), bench.folder / "campaigns")
    finally:
        catalogue.close()
    assert (found.run, found.tags) == ("a", ("battery 3",))
    assert found.metrics["duration_s"] > 1.0


def test_a_row_that_is_flown_again_is_a_run_with_the_same_log(bench: Bench) -> None:
    plan = 'experiment = "cases.py"\nseeds = 2\n[keep]\nlogs = "all"\n'
    kept = bench.flown(plan, "kept")
    again = bench.flown(plan.replace('"all"', '"none"'), "again")
    (bench.folder / "runs").mkdir()
    run = bench.folder / "runs" / "again_0000001"
    fly_again(again.path, 1, run, lambda share: None)
    log = (run / "station.mcap").read_bytes()
    assert log == kept.log_of(1).read_bytes()
    assert log != kept.log_of(0).read_bytes()
    assert described(run, None).id == run.name
