"""Sobol' indices, main effects, and the report with its figures."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from extensions.campaigns.analysis.effects import main_effect
from extensions.campaigns.analysis.sensitivity import cell_means, indices
from extensions.campaigns.design import Cells
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.plan import Plan
from extensions.campaigns.tests.conftest import COMPILED, Bench
from quadrotor.errors import StorageError

GRID = (
    COMPILED.replace("seeds = 5", "seeds = 3")
    + '[factors]\n"control.position.kp_xy" = [3.0, 4.0, 5.0]\n"simulator.payload" = [0.0, 0.2]\n'
)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> CampaignFolder:
    bench = Bench(tmp_path_factory.mktemp("report"), None)  # type: ignore[arg-type]
    return bench.flown(GRID, "gains")


def made_up(design: dict[str, Any], function: Any) -> tuple[Cells, pa.Table]:
    """Return cells, and rows in which a function of the factors is the metric."""
    cells = Cells(Plan.model_validate({"experiment": "hover", "seeds": 2, **design}))
    every = np.arange(cells.flights) // 2
    columns = {name: cells.column(name, every) for name in cells.plan.factors}
    values = function(*(np.array(one) for one in columns.values()))
    return cells, pa.table({"index": np.arange(cells.flights), **columns, "m": values})


def test_the_indices_of_ishigamis_function_are_the_known_ones() -> None:
    pi = {"from": -math.pi, "to": math.pi}
    cells, table = made_up(
        {"design": "saltelli", "samples": 1024, "factors": {"a": pi, "b": pi, "c": pi}},
        lambda a, b, c: np.sin(a) + 7.0 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a),
    )
    found = indices(cells, table, "m")
    assert [one["factor"] for one in found] == ["a", "b", "c"]
    assert [one["first"] for one in found] == pytest.approx([0.3139, 0.4424, 0.0], abs=0.03)
    assert [one["total"] for one in found] == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.03)
    assert all(0.0 < one["total_95"] < 0.1 for one in found)


def test_indices_need_a_value_in_each_cell() -> None:
    unit = {"from": 0.0, "to": 1.0}
    cells, table = made_up(
        {"design": "saltelli", "samples": 8, "factors": {"a": unit, "b": unit}},
        lambda a, b: np.where(np.arange(len(a)) < 2, np.nan, a + b),
    )
    assert np.isnan(cell_means(cells, table, "m")).tolist() == [True] + [False] * 31
    assert indices(cells, table, "m") == []


def test_a_main_effect_is_the_median_over_all_other_factors() -> None:
    cells, table = made_up(
        {"factors": {"a": [1, 2, 3], "b": [0.0, 10.0, 20.0]}}, lambda a, b: a + b
    )
    found = main_effect(cells, table, "m", "a")["levels"]
    assert [(one["level"], one["median"]) for one in found] == [("1", 11), ("2", 12), ("3", 13)]
    assert all(one["low"] <= one["median"] <= one["high"] for one in found)


def test_sobol_indices_are_shown(bench: Any) -> None:
    plan = (
        COMPILED.replace("seeds = 5", 'seeds = 1\ndesign = "saltelli"\nsamples = 8')
        + '[factors]\n"simulator.payload" = { from = 0.0, to = 0.3 }\n'
        '"control.position.kp_xy" = { distribution = "uniform", loc = 3.0, scale = 2.0 }\n'
    )
    folder = bench.flown(plan, "out")
    assert folder.flights == 8 * 4
    said = bench.quadlab("show", folder.path)[1]
    assert "Sobol' indices of position_rms_m" in said
    assert re.search(r"simulator.payload +\d\.\d+ ± \d", said)


def test_the_report_is_one_file_with_figures_and_no_network(
    bench: Any, flown: CampaignFolder
) -> None:
    page = bench.folder / "report.html"
    status, said, _ = bench.quadlab("show", flown.path, "--report", page)
    assert (status, said.strip()) == (0, str(page))
    text = page.read_text()
    assert "Campaign gains" in text
    assert "18 of 18" in text
    captions = re.findall(r"<strong>\d\. ([^.]+)\.</strong>", text)
    assert captions == [
        "Distributions",
        "Main effects",
        "Medians over two factors",
        "Scatter matrix",
        "Parallel coordinates",
    ]
    assert text.count("data:image/svg+xml;base64,") == 5
    assert re.search(r'(src|href)="(https?:)?//', text) is None
    assert bench.quadlab("show", flown.path, "--report", page)[0] == 0  # replaced
    other = bench.folder / "thesis.html"
    other.write_text("mine")
    assert "exists and is no report" in bench.refused("show", flown.path, "--report", other)


def test_figures_for_a_paper_have_their_fonts(bench: Any, flown: CampaignFolder) -> None:
    status, said, _ = bench.quadlab("show", flown.path, "--figures", bench.folder / "figures")
    assert status == 0
    files = sorted((bench.folder / "figures").iterdir())
    assert len(files) == len(said.split()) == 10
    for one in files:
        data = one.read_bytes()
        if one.suffix == ".svg":
            assert b"<text" not in data  # outlines
            assert b"<path" in data
        else:
            assert b"/FontFile2" in data  # TrueType, embedded
            assert b"/Type3" not in data


def test_a_report_without_rows_says_so(bench: Any) -> None:
    folder = bench.flown(COMPILED, "none")
    next(folder.rows.iterdir()).unlink()
    with pytest.raises(StorageError, match="no rows yet"):
        folder.table()
    assert "no rows yet" in bench.refused("show", folder.path, "--report", bench.folder / "r.html")
