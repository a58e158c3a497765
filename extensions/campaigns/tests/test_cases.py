"""Cases of a plan: settings that belong together, among which a factor chooses."""

from __future__ import annotations

from typing import Any

import pytest

from extensions.campaigns.design import Cells
from extensions.campaigns.plan import Plan, parse_plan
from extensions.campaigns.settings import Settings
from extensions.campaigns.tests.conftest import COMPILED

WORLDS = """
[cases.world]
calm = {}
"a motor - 10 %" = { "simulator.motor_gain_left" = 0.9 }
windy = { "simulator.drag" = 0.3, "simulator.wind_x" = 5.0 }
[cases.gains]
usual = {}
stiff = { "control.preset" = "stiff", "control.position.kp_xy" = 5.5 }
"""


def settings_of(text: str, tmp_path: Any) -> Settings:
    file = parse_plan(text, tmp_path / "plan.toml")
    return Settings(file, Cells(file.plan))


def test_a_factor_of_cases_has_each_of_them_with_its_settings_in_their_order(tmp_path: Any) -> None:
    found = settings_of(COMPILED + WORLDS, tmp_path)
    found.check()
    assert found.cells.number == 6
    assert found.cells.factors(5) == {"world": "windy", "gains": "stiff"}
    fixed = ["experiment.duration=2.0", "experiment.hover=0.5"]
    assert found.words(0) == fixed
    assert found.words(5) == [
        *fixed,
        "simulator.drag=0.3",
        "simulator.wind_x=5.0",
        "control.preset=stiff",
        "control.position.kp_xy=5.5",
    ]
    values = dict(found.values(range(6)))[5]
    assert values["control.position.kp_xy"] == 5.5  # not that of the preset before
    assert values["control.position.kv_xy"] == 4.5


def test_a_list_chooses_among_cases(tmp_path: Any) -> None:
    chosen = '[factors]\nworld = ["windy", "calm"]\ngains = ["usual", "stiff"]\n'
    text = COMPILED.replace("seeds", 'design = "zip"\nseeds') + WORLDS + chosen
    found = settings_of(text, tmp_path).cells
    assert [tuple(found.factors(k).values()) for k in range(found.number)] == [
        ("windy", "usual"),
        ("calm", "stiff"),
    ]


def test_rows_of_cases_have_their_names_and_fly_with_their_settings(bench: Any) -> None:
    table = bench.flown(COMPILED + WORLDS, "out").table()
    assert table.column_names[2:4] == ["world", "gains"]
    weak = COMPILED.replace("seeds = 5", "seeds = 15") + '"simulator.motor_gain_left" = 0.9\n'
    alone = bench.flown(weak, "alone").table()
    assert table["world"].to_pylist()[10:15] == ["a motor - 10 %"] * 5
    assert table["position_rms_m"][10:15].equals(alone["position_rms_m"][10:15])  # the same seeds


@pytest.mark.parametrize(
    ("parts", "line"),
    [
        ({"cases": {"index": {"a": {}}}}, 'cases."index": a name has letters'),
        ({"cases": {"wall_s": {"a": {}}}}, 'cases."wall_s": a name has letters'),
        ({"cases": {"a.b": {"a": {}}}}, 'cases."a.b": a name has letters'),
        ({"cases": {"world": {}}}, r"cases.world has no case; write one, as \[cases.world.calm\]"),
        (
            {"cases": {"world": {"windy": {}}}, "factors": {"world": ["wimdy"]}},
            r"factors.world: there is no case 'wimdy'; did you mean windy\?",
        ),
        (
            {"cases": {"world": {"a": {}}}, "factors": {"world": {"from": 0, "to": 1}}},
            "factors.world: cases are chosen by a list",
        ),
        (
            {"cases": {"world": {"a": {"x.y": 1}}}, "factors": {"x.y": [1, 2]}},
            'cases.world."a": x.y is a factor, or searched, too',
        ),
        (
            {
                "cases": {"world": {"a": {"x.y": 1}}},
                "search": {"trials": 1, "aims": ["a"], "parameters": {"x.y": [1, 2]}},
            },
            'cases.world."a": x.y is a factor, or searched, too',
        ),
    ],
)
def test_cases_that_cannot_be_are_refused(parts: Any, line: str) -> None:
    with pytest.raises(ValueError, match=line):
        Plan.model_validate({"experiment": "hover", **parts})


def test_a_setting_of_a_case_that_is_out_of_bounds_is_told_with_its_cell(bench: Any) -> None:
    plan = bench.plan(COMPILED + WORLDS.replace("= 5.0", "= 99.0"))
    line = bench.refused("run", plan, "--out", bench.folder / "out")
    assert "factors: cell 4: simulator.wind_x" in line
    assert "15" in line
