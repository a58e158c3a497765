"""Stored results of the arena: who is first how often, and what the page shows of a file."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from extensions.laws.arena.results import Cell, as_json, read_cells, standings
from quadrotor.errors import StorageError
from tests.web.conftest import site
from tests.web.dom.conftest import context, dom, look_at, open_page

__all__ = ["context", "dom", "look_at", "open_page", "site"]
FALLEN = math.nan


def cell(law: str, course: str, *rms: float) -> Cell:
    return Cell(law, course, "wind", np.array(rms), 0.1, effort=20.0, tick=math.nan)


CELLS = [
    cell("geometric", "slow", 0.020, 0.022, 0.024),
    cell("indi", "slow", 0.010, 0.011, 0.012),
    cell("nmpc", "slow", 0.0119, 0.0119, 0.0119),
    cell("geometric", "fast", 0.1, 0.1, 0.1),
    cell("indi", "fast", FALLEN, FALLEN, 0.1),
    cell("nmpc", "fast", 0.05, FALLEN, 0.05),
    cell("geometric", "too fast", FALLEN, FALLEN, FALLEN),
    cell("indi", "too fast", FALLEN, FALLEN, FALLEN),
    cell("nmpc", "too fast", FALLEN, FALLEN, FALLEN),
]


def test_a_law_near_the_first_most_often_is_before_the_others_and_crashes_count() -> None:
    nmpc, indi, geometric = standings(CELLS)
    assert (nmpc.law, nmpc.first, nmpc.near, nmpc.lines) == ("nmpc", 1, 2, 2)
    assert (indi.law, indi.first, indi.near) == ("indi", 1, 1)
    assert (geometric.first, geometric.near) == (0, 0)
    assert [one.crashed for one in (nmpc, indi, geometric)] == [4, 5, 3]
    assert {one.flights for one in (nmpc, indi, geometric)} == {9}
    assert nmpc.over_first == pytest.approx(math.sqrt(0.0119 / 0.011))
    assert indi.over_first == 1.0  # of the line that it flies
    assert geometric.over_first == pytest.approx(2.0)


def test_what_is_written_is_read_and_other_files_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    file.write_text(as_json(CELLS))
    for one, read in zip(CELLS, read_cells(file), strict=True):
        assert (one.entry, one.course, one.disturbance) == (
            read.entry,
            read.course,
            read.disturbance,
        )
        assert np.array_equal(one.rms, read.rms, equal_nan=True)
        assert (read.saturated, read.effort) == (one.saturated, one.effort)
        assert math.isnan(read.tick)
    older = [{"law": "a", "course": "8", "disturbance": "wind", "position_rms_m": [None]}]
    file.write_text(json.dumps(older))
    assert math.isnan(read_cells(file)[0].effort)
    for text in ("{}x", "3", '[{"law": "a"}]', "[3]", "[" * 100_000):
        file.write_text(text)
        with pytest.raises(StorageError, match=r"a\.json is no result of the arena .*--out"):
            read_cells(file)


def test_the_page_lists_results_and_shows_the_standings(
    site: Any, open_page: Any, look_at: Any
) -> None:
    folder = site.data / "arena"
    page = open_page(site)
    page.goto(f"{site.base}/runs")
    page.click("#arena summary")
    look = look_at(page)
    look.text("#arena .empty", r"^No result yet\. Write one with: quadlab arena --out .*/arena/")
    folder.mkdir(exist_ok=True)
    (folder / "monday.json").write_text(as_json(CELLS))
    client = site.sign_in()
    shown = client.get("/api/arena/monday").json()
    assert [line["course"] for line in shown["lines"]] == ["slow", "fast", "too fast"]
    assert shown["lines"][2]["laws"][0]["median"] is None
    refused = client.get("/api/arena/tuesday")
    assert (refused.status_code, "no result 'tuesday' in" in refused.text) == (404, True)
    page.click("#arena summary")
    page.click("#arena summary")
    look.text("#arena tbody tr:nth-child(1) td:nth-child(3)", "^2 of 2$")
    look.text("#arena figcaption >> nth=0", "^slow mm$")
    page.select_option('#arena [aria-label="drawing"]', "against effort")
    look.text("#arena figcaption >> nth=0", r"^slow mm over N/s$")
    look.text("#arena g title >> nth=0", r"^geometric, wind: 22\.0 mm, 20\.0 N/s$")
    page.select_option('#arena [aria-label="drawing"]', "against time of a tick")
    look.text("#arena .courses .empty >> nth=0", "^This result does not have it")
