"""Plans: cells, seeds, and what is refused before the first flight."""

from __future__ import annotations

import json
import re
from itertools import product
from typing import Any

import numpy as np
import pytest

from extensions.campaigns.design import Cells, seed_of
from extensions.campaigns.plan import Plan
from extensions.campaigns.settings import Settings
from quadlab.simulated.experiment import LARGEST_SEED

KP, DRAG = "control.position.kp_xy", "simulator.drag"


def cells(**parts: Any) -> Cells:
    return Cells(Plan.model_validate({"experiment": "hover", **parts}))


def listed(made: Cells) -> list[tuple[Any, ...]]:
    every = np.arange(made.number)
    return list(zip(*(made.column(name, every) for name in made.plan.factors), strict=True))


def test_a_grid_has_all_combinations_and_a_cell_is_the_same_alone() -> None:
    made = cells(factors={KP: [3, 4.5], DRAG: {"from": 0.0, "to": 0.4, "number": 3}})
    assert listed(made) == list(product([3.0, 4.5], [0.0, 0.2, 0.4]))
    assert [tuple(made.factors(k).values()) for k in range(6)] == listed(made)


def test_zip_and_one_at_a_time() -> None:
    factors = {"a.b": [1, 2, 3], "c.d": [10, 20, 30]}
    assert listed(cells(factors=factors, design="zip")) == [(1, 10), (2, 20), (3, 30)]
    one = cells(factors=factors, design="one_at_a_time")
    assert listed(one) == [(1, 10), (2, 10), (3, 10), (1, 20), (1, 30)]


def test_a_logarithmic_range_has_equal_ratios() -> None:
    made = cells(factors={KP: {"from": 0.01, "to": 1.0, "number": 3, "log": True}})
    np.testing.assert_allclose([value for (value,) in listed(made)], [0.01, 0.1, 1.0])


@pytest.mark.parametrize("design", ["random", "latin_hypercube", "sobol"])
def test_a_sampled_design_follows_from_the_seed_and_keeps_its_bounds(design: str) -> None:
    factors = {
        KP: {"from": 2.0, "to": 6.0},
        DRAG: {"distribution": "norm", "loc": 1.0, "scale": 0.1},
        "control.preset": ["standard", "stiff"],
    }
    made = cells(factors=factors, design=design, samples=64)
    assert listed(made) == listed(cells(factors=factors, design=design, samples=64))
    other = cells(factors=factors, design=design, samples=64, seed=2)
    assert listed(made) != listed(other)
    gains, drags, presets = zip(*listed(made), strict=True)
    assert 2.0 <= min(gains) < 2.5
    assert 5.5 < max(gains) <= 6.0
    assert abs(np.median(drags) - 1.0) < 0.05
    assert 20 < presets.count("stiff") < 44


def test_a_latin_hypercube_has_one_value_in_each_stripe() -> None:
    made = cells(factors={KP: {"from": 0, "to": 8}}, design="latin_hypercube", samples=8)
    assert sorted(int(value) for (value,) in listed(made)) == list(range(8))


@pytest.mark.parametrize("design", ["random", "latin_hypercube", "sobol"])
def test_correlated_factors_keep_their_distributions(design: str) -> None:
    from scipy.stats import kstest, norm

    made = cells(
        factors={
            "a.b": {"distribution": "norm", "loc": 1.0, "scale": 0.5},
            "c.d": {"from": 0.0, "to": 2.0},
            "e.f": {"distribution": "norm"},
        },
        correlations=[{"factors": ["a.b", "c.d"], "rho": -0.8}],
        design=design,
        samples=1024,
    )
    a, c, e = (np.array(one) for one in zip(*listed(made), strict=True))
    scores = norm.ppf(c / 2.0)
    assert np.corrcoef((a - 1.0) / 0.5, scores)[0, 1] == pytest.approx(-0.8, abs=0.04)
    assert abs(np.corrcoef(a, e)[0, 1]) < 0.1
    assert kstest((a - 1.0) / 0.5, norm.cdf).pvalue > 0.01
    assert kstest(c / 2.0, lambda x: x).pvalue > 0.01


def test_the_seed_of_a_flight_is_a_hash_of_the_plans_seed_and_its_index() -> None:
    plan = Plan(experiment="hover", seeds=1)
    seeds = [seed_of(plan, k) for k in range(10_000)]
    assert seeds[:3] == [2_025_564_315, 35_911_965, 1_595_528_887]
    assert all(0 <= seed <= LARGEST_SEED for seed in seeds)
    assert len(set(seeds)) == 10_000
    assert abs(np.mean(seeds) / LARGEST_SEED - 0.5) < 0.01
    assert seed_of(Plan(experiment="hover", seed=2), 0) != seeds[0]


REFUSED = {
    'experiment = "hover"\nsed = 3': r"sed: is not known; did you mean seed or seeds\?",
    "seeds = 3": "experiment: is missing",
    'experiment = "hover"\nseeds = 0': "seeds: input should be greater than or equal to 1, not 0",
    'experiment = "hover"\nseeds = true': "seeds: input should be a valid integer, not True",
    "experiment = hover": "is not TOML",
    '[factors]\n"simulator.drag" = [nan]': "0: nan is no value; take a f",
    '[factors]\n"simulator.drag" = []': "is empty; write a value",
    'experiment = "closed_loop"\nlimits = { position_rms = 0.1 }': (
        "has no metric 'position_rms'; did you mean position_rms_m"
    ),
    'experiment = "hovr"': "unknown experiment 'hovr'",
    'experiment = "hover"\nboard = "none"': "none",
    'experiment = "own.py"': "there is no file",
    '[factors]\n"control.position.kp_x" = [1.0]': r"cell 0: unknown parameter .*kp_xy",
    '[fixed]\n"control.position.kp_x" = 1.0': r"unknown parameter .*kp_xy",
    '[factors]\n"control.position.kp_xy" = [3.0, 4000.0]': "cell 1: .*4000 is out of bounds; all",
    '[factors]\n"control.position.kp_xy" = [3.0, "four"]': "cell 1: .*must be a number",
    'design = "random"\nsamples = 200\n[factors]\n'
    '"simulator.drag" = { distribution = "norm", loc = 0.1, scale = 0.1 }': (
        "cell .*simulator.drag = -.* out of bounds.* the distribution leaves the bounds: narrow it"
    ),
    '[factors]\n"simulator.drag" = { distribution = "nrm", number = 3 }': (
        "scipy.stats has no distribution 'nrm'; did you mean norm"
    ),
    '[factors]\n"simulator.drag" = { distribution = "norm", width = 3, number = 3 }': "norm: .*wid",
    '[factors]\n"simulator.drag" = { from = 2.0, to = 1.0, number = 3 }': "is not below",
    '[factors]\n"simulator.drag" = { from = 0.0, to = 1.0 }': "needs number",
    'design = "sobol"\nsamples = 100\n[factors]\n"simulator.drag" = [0.0]': "take 64 or 128",
    'design = "zip"\n[factors]\n"simulator.drag" = [0.0]\n"simulator.payload" = [0.0, 0.1]': (
        "as many values of each factor; has simulator.drag 1, simulator.payload 2"
    ),
    'correlations = [{ factors = ["simulator.drag", "simulator.payload"], rho = 0.5 }]\n'
    '[factors]\n"simulator.drag" = [0.0]\n"simulator.payload" = [0.0]': (
        'correlations: design = "grid" has independent factors; take random'
    ),
    'design = "random"\nsamples = 4\n'
    'correlations = [{ factors = ["simulator.drag", "simulator.drg"], rho = 0.5 }]\n'
    '[factors]\n"simulator.drag" = [0.0]': (
        "simulator.drg is no factor; did you mean simulator.drag"
    ),
    '[fixed]\n"simulator.drag" = 0.1\n[factors]\n"simulator.drag" = [0.0]': "both fixed and a fac",
    # each value is allowed, but not the pair of them
    '[factors]\n"behavior.volume_x_min" = [-2.0, 1.5]\n"behavior.volume_x_max" = [1.0]': (
        "cell 1: behavior.volume_x_min = 1.5 is not below"
    ),
    '[factors]\n"experiment.laps" = ["rest_to_rest"]\n"experiment.yaw_amplitude" = [0.2, 1.0]': (
        "cell 1: .*too much yaw torque"
    ),
    'seeds = 1000\n[factors]\n"simulator.drag" = { from = 0, to = 1, number = 1000000 }\n'
    '"simulator.payload" = { from = 0, to = 1, number = 1000 }': (
        r"the plan has 1e\+12 flights .* allowed are 1e\+07; .*latin_hypercube"
    ),
}


@pytest.mark.parametrize("text", REFUSED)
def test_a_plan_that_cannot_be_flown_is_refused_with_one_line(text: str, bench: Any) -> None:
    whole = text if "experiment = " in text or text == "seeds = 3" else _with_experiment(text)
    line = bench.refused("run", bench.plan(whole), "--out", bench.folder / "out")
    assert re.search(REFUSED[text], line), line
    assert not (bench.folder / "out").exists()


def test_the_bytes_of_a_plan_are_utf_8_with_or_without_a_mark(bench: Any) -> None:
    plan = bench.plan("")
    plan.write_bytes('experiment = "closed_loop" # \u00b0'.encode("utf-16"))
    assert "plan.toml is no UTF-8 text: byte 0; save it as" in bench.refused("check", plan)
    plan.write_bytes('experiment = "closed_loop" # \u00b0'.encode("utf-8-sig"))
    assert bench.quadlab("check", plan)[0] == 0


def _with_experiment(text: str) -> str:
    return f'experiment = "figure_eight"\n{text}'


def test_check_tells_what_a_plan_flies(bench: Any) -> None:
    assert bench.quadlab("new", "--out", bench.folder / "mine.toml")[0] == 0
    status, said, _ = bench.quadlab("check", bench.folder / "mine.toml")
    assert status == 0
    assert "12 flights of figure_eight: 3 cells (grid), 4 seeds each" in said
    assert "control.position.kp_xy: 3, 4, 5" in said
    assert "0.167 h of simulated flight" in said
    schema = json.loads((bench.folder / "mine.schema.json").read_text())
    assert schema["required"] == ["experiment"]
    assert {"factors", "keep", "design"} <= schema["properties"].keys()
    assert "exists; give another" in bench.refused("new", "--out", bench.folder / "mine.toml")


def test_the_words_of_a_cell_give_its_values(bench: Any) -> None:
    from extensions.campaigns.plan import read_plan

    path = bench.plan(
        'experiment = "hover"\nlaw = "geometric"\nfaults = "motors.fade from=12 ramp=3"\n'
        '[fixed]\n"simulator.drag" = 0.1\n'
        '[factors]\n"control.preset" = ["stiff"]\n"mass.used_by" = ["estimate"]\n'
        '"tracker.positions_only" = [true]'
    )
    file = read_plan(path)
    settings = Settings(file, Cells(file.plan))
    settings.check()
    assert settings.words(0) == [
        "simulator.drag=0.1",
        "control.law=geometric",
        "faults=motors.fade from=12 ramp=3",
        "control.preset=stiff",
        "mass.used_by=estimate",
        "tracker.positions_only=true",
    ]
