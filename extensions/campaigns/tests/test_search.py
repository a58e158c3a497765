"""Searches: reproducible from their seed, resumable, with constraints that are held."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from optuna.trial import TrialState

from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.search import study
from extensions.campaigns.search.plan import Search
from extensions.campaigns.search.study import rounds
from extensions.campaigns.search.told import none_feasible, outcome
from extensions.campaigns.search.trial import PENALTY, Row, front, judge
from extensions.campaigns.tests.conftest import COMPILED, rows
from quadrotor.errors import UsageError

TRIALS = """
[factors]
"simulator.payload" = [0.0, 0.1]
[search]
trials = 12
together = 3
aims = ["position_rms_m"]
{more}
[search.parameters]
"control.position.kp_xy" = {{ from = 2.0, to = 8.0, log = true }}
"control.attitude.kr_xy" = {{ from = 20.0, to = 120.0 }}
"""


def plan(more: str = "", text: str = COMPILED) -> str:
    return text.replace("seeds = 5", "seeds = 3") + TRIALS.format(more=more)


@pytest.fixture(scope="module")
def searched(tmp_path_factory: pytest.TempPathFactory) -> CampaignFolder:
    from extensions.campaigns.tests.conftest import Bench

    bench = Bench(tmp_path_factory.mktemp("search"), None)  # type: ignore[arg-type]
    return bench.searched(plan(), "out")


def test_a_search_is_the_same_with_any_workers_and_when_it_is_resumed(
    bench: Any, searched: CampaignFolder
) -> None:
    other = bench.run(bench.plan(plan()), "other", "--workers", 2)
    assert rows(other).equals(rows(searched))
    assert other.cells.trials == searched.cells.trials
    part = bench.searched(plan(), "part", at_most=20)
    assert part.table().num_rows == 20
    assert rows(bench.searched(plan(), "part")).equals(rows(searched))


def test_the_trials_of_a_search_have_the_same_seeds_and_the_first_has_the_defaults(
    searched: CampaignFolder,
) -> None:
    table, cells = searched.table(), searched.cells
    seeds: dict[int, set[int]] = {}
    for index, seed in zip(table["index"].to_pylist(), table["seed"].to_pylist(), strict=True):
        seeds.setdefault(cells.trial(index), set()).add(seed)
    whole = [one for one in seeds.values() if len(one) == 6]
    assert len(whole) >= 8
    assert all(one == whole[0] for one in whole)
    from control.parameters import ControlParameters

    assert cells.trials[0]["control.position.kp_xy"] == ControlParameters().position.kp_xy


def test_the_best_trial_is_that_with_the_smallest_worst_flight(
    bench: Any, searched: CampaignFolder
) -> None:
    found = json.loads(bench.quadlab("show", searched.path, "--json")[1])["search"]
    table, cells = searched.table(), searched.cells
    worst: dict[int, float] = {}
    flown: dict[int, int] = {}
    for index, error in zip(
        table["index"].to_pylist(), table["position_rms_m"].to_pylist(), strict=True
    ):
        trial = cells.trial(index)
        worst[trial] = max(error, worst.get(trial, 0.0))
        flown[trial] = flown.get(trial, 0) + 1
    whole = {trial: value for trial, value in worst.items() if flown[trial] == 6}
    assert found["best"] == [min(whole, key=lambda trial: whole[trial])]
    assert whole[found["best"][0]] <= whole[0]
    said = bench.quadlab("show", searched.path)[1]
    assert f"best: trial {found['best'][0]}: worst position_rms_m " in said
    assert "--set control.position.kp_xy=" in said


def test_a_search_without_a_feasible_trial_says_so(bench: Any) -> None:
    text = plan("constraints = { position_rms_m = 1e-6 }").replace("= 12", "= 3")
    status, _, said = bench.quadlab(
        "run", bench.plan(text), "--out", bench.folder / "none", "--workers", 1
    )
    assert status == 1
    line = said.strip().splitlines()[-1]
    assert line.startswith("quadlab: none of 3 trials is feasible: position_rms_m is ")
    assert line.endswith("widen the search, or its limits")


@pytest.mark.parametrize(
    ("margins", "words"),
    [
        ("delay_margin = 0.9", "0.9 s of delay"),
        ("phase_margin = 80", "80° of phase"),
        ("delay_margin = 0.05\nphase_margin = 80", "0.05 s of delay or 80° of phase"),
    ],
)
def test_a_trial_below_a_margin_is_not_flown(bench: Any, margins: str, words: str) -> None:
    text = plan(margins).replace("= 12", "= 3")
    found = bench.searched(text, "out")
    assert f"none of 3 trials is feasible: a margin below {words} (3 trials)" in none_feasible(
        outcome(found, None)
    )
    assert list(found.rows.iterdir()) == []


def test_trials_that_were_never_flown_do_not_end_others_early() -> None:
    """A trial is compared with the median of eight flown ones, not with that of the first alone."""
    parts = {"trials": 20, "aims": ["a"], "parameters": {"x.y": {"from": 0.0, "to": 1.0}}}
    search = Search.model_validate(parts)
    made = study.new_study(search, 1, None)
    proposals = study.distributions(search)

    def is_ended(value: float) -> bool:
        trial = made.ask(proposals)
        trial.report(value, 1)
        ends = trial.should_prune()
        made.tell(trial, None if ends else value, state=TrialState.PRUNED if ends else None)
        return ends

    for _ in range(20):  # refused by their margins
        made.tell(made.ask(proposals), 2e6)
    assert [is_ended(1.0 + k) for k in range(8)] == [False] * 8
    assert is_ended(9.0)
    assert not is_ended(1.5)


@pytest.mark.parametrize("sampler", ["cma_es", "nsga2", "random"])
def test_each_sampler_is_reproducible(bench: Any, sampler: str) -> None:
    more = f'sampler = "{sampler}"'
    if sampler == "nsga2":
        more += '\naims = ["position_rms_m", "tilt_max_deg"]'
    text = plan(more)
    if sampler == "nsga2":
        text = text.replace('aims = ["position_rms_m"]\n', "", 1)
    trials = [bench.searched(text, name).cells.trials for name in ("one", "two")]
    assert trials[0] == trials[1]
    assert len({tuple(one.values()) for one in trials[0].values()}) == 12


def test_searches_that_cannot_be_flown_are_refused_with_one_line(
    bench: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(text: str) -> str:
        line: str = bench.refused("run", bench.plan(text), "--out", bench.folder / "out")
        assert not (bench.folder / "out").exists()
        return line

    assert "search.trails: is not known; did you mean trials" in refused(plan("trails = 3"))
    assert "search.parameters: control.position.kp_xy = 8000 is out of bounds" in refused(
        plan().replace("to = 8.0", "to = 8000.0")
    )
    assert "control.position.kp_xy is searched, and fixed" in refused(
        plan(text=COMPILED + '"control.position.kp_xy" = 3.0\n')
    )
    two = plan('sampler = "cma_es"').replace('["position_rms_m"]', '["position_rms_m", "yaw"]')
    assert 'has one aim: take "nsga2"' in refused(two)
    assert "a search chooses each trial by those before" in bench.refused(
        "run", bench.plan(plan()), "--out", bench.folder / "shard", "--shard", "1/2"
    )
    monkeypatch.setattr(study, "find_spec", lambda name: None)
    assert "search needs optuna: pip install 'quadlab[campaigns]'" in refused(plan())


def test_an_aim_that_no_flight_has_ends_the_search(bench: Any) -> None:
    text = plan().replace("position_rms_m", "position_rms")
    with pytest.raises(UsageError) as refused:
        bench.searched(text, "out")
    line = str(refused.value)
    assert "no flight has the metric 'position_rms'" in line


def test_rounds_end_with_all_seeds() -> None:
    assert [rounds(n) for n in (1, 2, 3, 8, 12)] == [
        [1],
        [1, 2],
        [1, 2, 3],
        [1, 2, 4, 8],
        [1, 2, 4, 8, 12],
    ]


def test_a_trial_is_judged_by_its_worst_flight_and_what_it_lacks() -> None:
    search = Search.model_validate(
        {"trials": 1, "parameters": {"a": [1, 2]}, "aims": ["error"], "constraints": {"tilt": 30.0}}
    )
    good = judge(search, [Row(True, (1.0, 20.0)), Row(True, (3.0, 25.0))])
    assert (good.values, good.reason, good.values_told(1)) == ((3.0,), "", [3.0])
    tilted = judge(search, [Row(True, (1.0, 33.0)), Row(True, (3.0, 25.0))])
    assert tilted.lacks["tilt"] == 3.0
    assert tilted.reason == "tilt is 33, at most 30 is feasible"
    fallen = judge(search, [Row(True, (1.0, 20.0)), Row(False, (np.nan, np.nan))])
    assert fallen.reason == "1 of 2 flights did not pass"
    assert fallen.values_told(1) == [2 * PENALTY]


def test_the_front_has_what_nothing_else_is_better_than() -> None:
    assert front([(1.0, 5.0), (2.0, 2.0), (3.0, 3.0), (5.0, 1.0)]) == [0, 1, 3]
