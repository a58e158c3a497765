"""The arena: what its flights find, its tables, its plans, and mistakes that are told."""

from __future__ import annotations

import csv
import json
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from bearing_sim.tracker import TrackerParameters
from control.trajectories.trajectory import sample_many
from extensions.laws.arena import table
from extensions.laws.arena.cells import DISTURBANCES, chosen, entries
from extensions.laws.arena.command import Arena
from extensions.laws.arena.courses import MOTION, PERIOD, courses
from extensions.laws.arena.flights import fly_cell
from extensions.laws.arena.results import Cell
from extensions.laws.tests.equations import LAWS
from quadrotor.errors import StorageError, UsageError
from quadrotor.records import REFERENCE
from quadrotor.vehicle_model import VehicleModel
from vehicle.simulator.parameters import SimulatorParameters

SEEDS = (1, 2)
EIGHT = courses()["8 in 8 s"]
PLANS = sorted((Path(__file__).parents[1] / "arena").glob("*.toml"))
SEARCHES = [path for path in PLANS if path.stem.startswith("tune_")]


def errors(law: str, disturbance: str, course: str = "8 in 8 s") -> float:
    rms = fly_cell(entries()[law], DISTURBANCES[disturbance], courses()[course], SEEDS).rms
    return float(np.max(np.where(np.isnan(rms), np.inf, rms)))


def test_courses_begin_and_end_at_rest_and_each_record_is_the_derivative_of_the_last() -> None:
    for name, course in courses().items():
        ticks = np.arange(round(course.duration / PERIOD) + 1, dtype=np.float64)
        at = sample_many(course, PERIOD * ticks)
        moving = [field for field in REFERENCE.names or () if field not in ("position_w", "yaw")]
        for end in (at[0], at[-1]):
            assert max(np.abs(end[field]).max() for field in moving) < 1e-6, name
        if name == "steps":
            assert {*at["position_w"][:, 0].tolist()} == {0.0, 0.5}
            continue
        for low, high in pairwise(MOTION):
            slope = np.gradient(at[low], PERIOD, axis=0)[1:-1]
            largest = np.abs(at[high]).max()
            assert np.abs(slope - at[high][1:-1]).max() < 0.01 * largest, (name, high)


def test_a_disturbance_names_what_a_vehicle_and_a_tracker_have() -> None:
    for one in DISTURBANCES.values():
        assert {*one.truth} <= {*SimulatorParameters.model_fields}
        assert {*one.identified} <= {*VehicleModel.model_fields}
        assert {*one.tracker} <= {*TrackerParameters.model_fields}


@pytest.mark.parametrize("law", [*entries()])
def test_every_law_flies_the_8(law: str) -> None:
    largest = {"pid_cascade": 0.06}.get(law, 0.004)
    assert errors(law, "nominal") < largest


@pytest.mark.parametrize("law", ["geometric", "observer", "geometric_l1", "indi", "flatness_indi"])
def test_the_lag_of_the_rotors_is_led_on_a_course_that_changes_the_thrust(law: str) -> None:
    """Without the lead each of them has 17 to 20 mm."""
    assert errors(law, "nominal", "upright 8, 2.5 m x 1.5 m in 6.28 s") < 0.004


@pytest.mark.parametrize(
    "disturbance", ["mass + 20 %", "drag", "wind 6 m/s, gusts", "motor - 15 %"]
)
def test_flatness_with_indi_cuts_the_error_of_the_plain_law_by_seventy_per_cent(
    disturbance: str,
) -> None:
    assert errors("flatness_indi", disturbance) < 0.3 * errors("geometric", disturbance)


@pytest.mark.parametrize("course", ["8 in 8 s", "3 m x 1.5 m in 4 s"])
@pytest.mark.parametrize("disturbance", ["mass + 20 %", "wind 6 m/s, gusts", "motor - 15 %"])
def test_l1_cuts_the_error_of_the_plain_law_by_eighty_per_cent(
    disturbance: str, course: str
) -> None:
    plain = errors("geometric", disturbance, course)
    assert errors("geometric_l1", disturbance, course) < 0.2 * plain


@pytest.mark.parametrize(
    ("course", "disturbance"),
    [
        ("3 m x 1.5 m in 4 s", "mass + 20 %"),
        ("3 m x 1.5 m in 3 s", "wind 6 m/s, gusts"),
        ("3 m x 1.5 m in 3 s", "mass + 20 %"),
        ("3 m x 1.5 m in 3 s", "latency 20 ms"),
        ("3 m x 1.5 m in 3 s", "motor - 15 %"),
    ],
)
def test_the_predictive_law_is_better_than_the_plain_one_on_fast_courses_and_falls_nowhere(
    course: str, disturbance: str
) -> None:
    """The motors saturate on the course in 3 s, and with a weak motor the plain law falls there."""
    plain = errors("geometric", disturbance, course)
    assert errors("nmpc", disturbance, course) < min(0.8 * plain, 0.45)


def test_a_crash_counts_as_infinite_and_is_told() -> None:
    rms = np.array([0.01, math.nan, math.nan, math.nan])
    base = Cell("geometric", "8", "wind", np.array([0.02, 0.02, 0.02, 0.02]), 0.0)
    lost = Cell("mine", "8", "wind", rms, 0.0)
    assert lost.failures == 3
    assert lost.median == math.inf
    assert lost.ratio_to(base)[0] == math.inf
    text = "\n".join(table.errors_table([base, lost]) + table.ratios_table([base, lost]))
    assert "3 of 4 crashed" in text
    assert "**20.0** (20.0 … 20.0)" in text
    assert "| crashes |" in text


def test_the_ratio_is_taken_seed_by_seed() -> None:
    base = Cell("geometric", "8", "wind", np.array([0.01, 0.1, 1.0]), 0.0)
    half = Cell("mine", "8", "wind", 0.5 * base.rms, 0.0)
    assert half.ratio_to(base) == (0.5, 0.5, 0.5)


def test_a_law_is_ranked_among_all_and_among_those_that_tolerate_as_much_latency() -> None:
    def cell(law: str, course: str, rms: float) -> Cell:
        return Cell(law, course, "wind", np.array([rms, rms]), 0.0)

    cells = [cell("geometric", "8", 0.02), cell("quick", "8", 0.01)]
    cells += [cell("geometric", "9", 0.0105), cell("quick", "9", math.nan)]
    facts = [table.Facts("geometric", 0.05, 1e-6), table.Facts("quick", 0.03, 2e-6)]
    _, _, slow, quick = table.facts_table(cells, facts)
    assert slow == (
        "| geometric | 1 of 2 | 1 of 2 | 2 of 2 | 0 of 4 | 50 ms | – | – | 1.0 µs | 1.00 |"
    )
    assert quick == "| quick | 1 of 2 | 1 of 2 | 1 of 2 | 2 of 4 | 30 ms | – | – | 2.0 µs | 2.00 |"


def test_tables_are_written_between_the_marks_only(tmp_path: Path) -> None:
    page = tmp_path / "arena.md"
    page.write_text(f"head\n{table.BEGIN}\nold\n{table.END}\ntail\n")
    table.write_into(page, ["", "| new |", ""])
    assert page.read_text() == f"head\n{table.BEGIN}\n\n| new |\n\n{table.END}\ntail\n"


def test_flights_are_written_as_csv_and_the_table_as_latex(tmp_path: Path) -> None:
    rms = np.array([0.01, math.nan, 0.03])
    cells = [Cell("mine_too", "8 in 8 s", "mass + 20 %", rms, 0.25, effort=12.5)]
    table.write_out(tmp_path / "flights.csv", cells)
    rows = list(csv.DictReader((tmp_path / "flights.csv").open()))
    assert [row["position_rms_m"] for row in rows] == ["0.01", "", "0.03"]
    assert {row["disturbance"] for row in rows} == {"mass + 20 %"}
    assert {(row["saturated_share"], row["effort_n_per_s"]) for row in rows} == {("0.25", "12.5")}
    table.write_out(tmp_path / "table.tex", cells)
    lines = (tmp_path / "table.tex").read_text().splitlines()
    assert lines[2] == r"course & disturbance & mine\_too \\"
    assert lines[4].startswith(r"8 in 8 s & mass + 20 \% & \textbf{30.0} (")
    table.write_out(tmp_path / "flights.json", cells)
    assert json.loads((tmp_path / "flights.json").read_text())[0]["position_rms_m"][1] is None
    with pytest.raises(StorageError, match=r"--out .*none.* cannot be written"):
        table.write_out(tmp_path / "none" / "a.csv", cells)


def test_mistakes_are_told_before_the_first_flight(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--laws 'mpc' is not in the arena; there are geometric"):
        chosen("geometric mpc")
    with pytest.raises(
        UsageError, match="--courses '8' is not in the arena; there are 8 in 8 s; 8"
    ):
        Arena(courses="8 in 8 s; 8").run()
    with pytest.raises(UsageError, match="allowed are 2 or more"):
        Arena(seeds=1).run()
    with pytest.raises(UsageError, match=r"--out a\.txt: allowed are \.json, \.csv, \.tex"):
        Arena(out=Path("a.txt")).run()
    page = tmp_path / "empty.md"
    page.write_text("no marks")
    with pytest.raises(UsageError, match="has no lines <!-- quadlab arena begins -->"):
        Arena(page=page).run()
    with pytest.raises(StorageError, match=r"nowhere\.md cannot be read"):
        Arena(page=tmp_path / "nowhere.md").run()


@pytest.mark.parametrize("path", PLANS, ids=[one.stem for one in PLANS])
def test_a_plan_can_be_flown(path: Path) -> None:
    plan = pytest.importorskip("extensions.campaigns.plan")
    from extensions.campaigns.design import Cells
    from extensions.campaigns.settings import Settings

    file = plan.read_plan(path)
    settings = Settings(file, Cells(file.plan))
    settings.check()
    if path not in SEARCHES:
        cells = range(settings.cells.number)
        laws = {settings.cells.factors(cell)["control.law"] for cell in cells}
        assert {"geometric", "indi"} <= laws <= entries().keys()


def test_the_plans_of_all_laws_search_by_one_budget() -> None:
    """But for nmpc, whose flights take a hundred times as long: it has fewer trials and seeds."""
    plan = pytest.importorskip("extensions.campaigns.plan")
    ours = {"geometric", "observer", *LAWS}
    assert {f"tune_{name}" for name in ours} == {path.stem for path in SEARCHES}
    budgets, flights = set(), {}
    for path in SEARCHES:
        one = plan.read_plan(path).plan
        search = one.search
        flights[path.stem] = search.trials * one.seeds
        budget = len(search.parameters), search.aggregate, search.sampler
        budgets.add((*budget, str(one.factors), str(search.aims)))
    assert len(budgets) == 1
    fewest = flights.pop("tune_nmpc")
    assert fewest < min(flights.values()) == max(flights.values()) == 200 * 12
