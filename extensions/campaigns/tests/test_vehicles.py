"""Campaigns of flights in which several vehicles fly together."""

from __future__ import annotations

import json
import shlex
from typing import Any

import pytest

from extensions.campaigns.settings import Settings
from extensions.campaigns.summary import command_of
from extensions.campaigns.tests.conftest import rows
from quadlab.__main__ import main

PAIR = """
experiment = "hover"
vehicles = 2
"""


def test_a_row_of_two_vehicles_is_the_flight_of_its_command(
    bench: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    flown = bench.flown(PAIR, "pair")
    (row,) = rows(flown).to_pylist()
    words = shlex.split(command_of(Settings(flown.plan, flown.cells), 0))
    assert words[words.index("--vehicles") + 1] == "2"
    capsys.readouterr()
    assert main([*words[1:], "--json", "--out", str(bench.folder)]) == 0
    again = json.loads(capsys.readouterr().out)["metrics"]
    assert row["verdict"] == "passed"
    assert row["collisions"] == 0.0
    assert row["separation_min_m"] > 1.5
    figures = [name for name in again if name not in ("wall_s", "processor_s", "speed")]
    assert len(figures) > 3
    assert {name: row[name] for name in figures} == {name: again[name] for name in figures}


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ('experiment = "closed_loop"\nvehicles = 2\n', "closed_loop flies one vehicle"),
        ('experiment = "hover"\nvehicles = 9\n', "vehicles"),
        ('experiment = "hover"\nvehicles = 2\nkeep.logs = "all"\n', "are not kept"),
    ],
)
def test_vehicles_that_cannot_fly_a_plan_are_refused(bench: Any, change: str, why: str) -> None:
    status, _, said = bench.quadlab("check", bench.plan(change))
    assert status == 2
    assert why in said
    assert "Traceback" not in said
