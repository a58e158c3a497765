"""Summaries of rows: intervals, quantiles, commands, and the comparison of two campaigns."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import quadlab
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.summary import quantile_interval, summarize, wilson
from extensions.campaigns.table import MACHINE, FileColumns, judged_metrics
from extensions.campaigns.tests.conftest import COMPILED

WEAK = COMPILED.replace("seeds = 5", "seeds = 12") + '"control.position.kp_xy" = 2.0\n'
FACTOR = COMPILED.replace("seeds = 5", "seeds = 2") + '[factors]\n"control.position.kp_xy" = {}\n'
STRONG = COMPILED.replace("seeds = 5", "seeds = 12") + '"control.position.kp_xy" = 5.0\n'


def test_wilsons_interval_of_a_share() -> None:
    # Newcombe (1998), table I, method 3
    for count, of, low, high in ((81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605)):
        assert wilson(count, of) == pytest.approx((low, high), abs=5e-5)
    assert wilson(0, 20) == pytest.approx((0.0, 0.1611), abs=5e-5)
    assert wilson(20, 20)[1] == 1.0


def test_the_interval_of_a_median_is_that_of_the_bootstrap() -> None:
    random = np.random.default_rng(1)
    values = np.sort(random.exponential(size=101))
    drawn = np.median(random.choice(values, (20_000, 101)), axis=1)
    low, high = np.quantile(drawn, [0.025, 0.975])
    assert quantile_interval(values, 0.5) == pytest.approx((low, high), abs=0.03)


def test_the_interval_of_a_median_covers_it() -> None:
    random = np.random.default_rng(2)
    covered = 0
    for _ in range(400):
        low, high = quantile_interval(np.sort(random.normal(size=40)), 0.5)
        covered += low <= 0.0 <= high
    assert 0.92 <= covered / 400 <= 0.99


def test_show_has_the_figures_of_each_cell(bench: Any) -> None:
    plan = COMPILED + '[factors]\n"control.position.kp_xy" = [3.0, 5.0]\n'
    flown = bench.flown(plan, "out")
    found = json.loads(bench.quadlab("show", flown.path, "--json")[1])
    assert (found["flights"], found["rows"], found["cells"], found["seeds"]) == (10, 10, 2, 5)
    assert found["verdicts"]["passed"]["count"] == 10
    errors = quadlab.campaign(flown.path)["position_rms_m"].to_numpy()
    figures = found["metrics"]["position_rms_m"]
    assert figures["median"] == np.median(errors)
    assert figures["minimum"] == errors.min()
    assert [one["factors"] for one in found["by_cell"]] == [
        {"control.position.kp_xy": 3.0},
        {"control.position.kp_xy": 5.0},
    ]
    assert found["by_cell"][1]["medians"]["position_rms_m"] == np.median(errors[5:])
    said = bench.quadlab("show", flown.path)[1]
    assert "10 of 10 flights, 2 cells of 5 seeds" in said
    assert "100.00%   95 %: 72.25% to 100.00%" in said


def test_a_finished_campaign_is_read_column_by_column_as_its_table(bench: Any) -> None:
    folder = bench.flown(COMPILED + '[factors]\n"simulator.drag" = [0.0, 0.1]\n', "out")
    columns, table = folder.table(figures_only=True), folder.table()
    assert isinstance(columns, FileColumns)
    assert columns.num_rows == table.num_rows == 10
    assert columns.column_names == [n for n in table.column_names if not n.startswith(MACHINE)]
    for name in columns.column_names:
        assert columns[name].to_pylist() == table[name].to_pylist(), name
    assert judged_metrics(columns) == judged_metrics(table) != []
    assert summarize(folder, columns) == summarize(folder, table)


def test_limits_of_the_plan_fail_a_flight(bench: Any) -> None:
    plan = COMPILED.replace("[fixed]", "limits = { position_rms_m = 1e-6 }\n[fixed]")
    table = bench.flown(plan, "out").table()
    assert set(table["verdict"].to_pylist()) == {"failed"}
    assert all(one.endswith("at most 1e-06 passes") for one in table["reason"].to_pylist())
    said = bench.quadlab("show", bench.folder / "out")[1]
    assert "flight 4: failed: position_rms_m is " in said


def test_the_metrics_that_the_plan_names_are_kept(bench: Any) -> None:
    plan = COMPILED.replace("[fixed]", 'metrics = ["tilt_max_deg"]\n[fixed]')
    names = bench.flown(plan, "out").table().column_names
    assert names[:5] == ["index", "seed", "verdict", "reason", "tilt_max_deg"]
    assert "position_rms_m" not in names


def test_a_worse_campaign_is_told_and_ends_with_status_1(bench: Any) -> None:
    weak, strong = bench.flown(WEAK, "weak"), bench.flown(STRONG, "strong")
    assert bench.quadlab("compare", weak.path, weak.path, "--limit")[0] == 0
    status, said, _ = bench.quadlab("compare", weak.path, strong.path, "--limit")
    assert status == 0
    assert "position_rms_m     better" in said
    assert "12 pairs of flights" in said
    status, said, _ = bench.quadlab("compare", strong.path, weak.path, "--limit")
    assert status == 1
    assert "position_rms_m     WORSE" in said
    assert bench.quadlab("compare", strong.path, weak.path)[0] == 0


def test_equal_campaigns_are_rarely_called_worse() -> None:
    from extensions.campaigns.compare import LEVEL, _metric

    random = np.random.default_rng(3)
    worse = sum(
        _metric(random.normal(size=20), random.normal(size=20))["p"] < LEVEL for _ in range(400)
    )
    assert worse / 400 < 2 * LEVEL


def test_campaigns_without_pairs_are_not_compared(bench: Any) -> None:
    one = bench.flown(COMPILED, "one")
    other = bench.flown(COMPILED.replace("seeds = 5", "seeds = 5\nseed = 9"), "other")
    assert "no flights with the same seed and factors" in bench.refused(
        "compare", one.path, other.path
    )


def test_a_folder_that_is_none_is_told(bench: Any) -> None:
    line = bench.refused("show", Path("nowhere"))
    assert "nowhere is no campaign (No such file or directory: campaign.json)" in line


def test_a_factor_of_whole_numbers_pairs_with_one_of_decimals(bench: Any) -> None:
    """Values that differ have no pair; 3 and 3.0 are one value."""
    one = bench.flown(FACTOR.format("[3, 4]"), "one")
    other = bench.flown(FACTOR.format("[3.0, 4.5]"), "other")
    said = bench.quadlab("compare", one.path, other.path)[1]
    assert "2 pairs of flights" in said
    assert "without a pair: 2 of the first, 2 of the second" in said


def test_rows_of_a_million_flights_are_summarised(bench: Any) -> None:
    import pyarrow as pa

    from extensions.campaigns.summary import summarize

    flown: CampaignFolder = bench.flown(COMPILED.replace("seeds = 5", "seeds = 1"), "out")
    count, random = 1_000_000, np.random.default_rng(1)
    table = pa.table(
        {
            "index": np.arange(count),
            "seed": random.integers(0, 2**31, count),
            "verdict": pa.array(["passed", "failed"]).take(pa.array(np.arange(count) % 2)),
            "reason": pa.array([""]).take(pa.array(np.zeros(count, int))),
            "position_rms_m": random.random(count),
        }
    )
    found = summarize(flown, table)
    assert found["verdicts"]["failed"]["share"] == 0.5
    assert found["metrics"]["position_rms_m"]["median"] == pytest.approx(0.5, abs=0.003)
