"""The course of a search: which flights each trial needs next, and when it is over.

The proposals of a seeded sampler follow from the trials before, and these from the rows: a search
that is resumed goes the same way again, and flies only what has no row.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from extensions.campaigns.engines.work import Work
from extensions.campaigns.factors import Value
from extensions.campaigns.flights import Outcome
from extensions.campaigns.search.kept import keep_trials
from extensions.campaigns.search.plan import Search
from extensions.campaigns.search.told import search_rows
from extensions.campaigns.search.trial import Judged, Row, judge
from extensions.campaigns.settings import Settings
from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from optuna import Study, Trial
    from optuna.distributions import BaseDistribution

INSTALL = "pip install 'quadlab[campaigns]'"
STARTUP = 8
"""Whole trials before one is ended by comparison with them."""


def check_library(name: str, what: str) -> None:
    """Raise UsageError without the library of which a plan makes use."""
    if find_spec(name) is None:
        raise UsageError(f"{what} needs {name}: {INSTALL}")


def new_study(search: Search, seed: int, first: Mapping[str, Value] | None) -> Study:
    """Return a study whose first trial has these values."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    kinds: dict[str, Callable[[], Any]] = {
        "tpe": lambda: optuna.samplers.TPESampler(seed=seed, multivariate=True),
        "nsga2": lambda: optuna.samplers.NSGAIISampler(seed=seed, population_size=24),
        "random": lambda: optuna.samplers.RandomSampler(seed=seed),
        "cma_es": lambda: optuna.samplers.CmaEsSampler(seed=seed),
    }
    # trials that were never flown count as whole ones, but have nothing to compare with
    pruner = optuna.pruners.MedianPruner(STARTUP, n_min_trials=STARTUP)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        study = optuna.create_study(
            sampler=kinds[search.sampler](),
            pruner=pruner if search.prune else optuna.pruners.NopPruner(),
            directions=["minimize"] * len(search.aims),
        )
    if first is not None:
        study.enqueue_trial(dict(first))
    return study


def distributions(search: Search) -> dict[str, BaseDistribution]:
    """Return the values that the sampler may propose, as distributions by parameter."""
    from optuna.distributions import CategoricalDistribution, FloatDistribution

    return {
        name: CategoricalDistribution(one)
        if isinstance(one, list)
        else FloatDistribution(one.low, one.high, log=one.log)
        for name, one in search.parameters.items()
    }


def defaults(search: Search, settings: Settings) -> dict[str, Value] | None:
    """Return the values that the vehicle has without a search; None if some may not be proposed."""
    found: dict[str, Value] = {}
    for name, one in search.parameters.items():
        if name not in settings.store.values():  # a gain set, which is no parameter itself
            return None
        value = settings.store.get(name)
        is_inside = value in one if isinstance(one, list) else _between(one.low, value, one.high)
        if not is_inside:
            return None
        found[name] = value
    return found


def _between(low: float, value: object, high: float) -> bool:
    return isinstance(value, int | float) and low <= value <= high


def lacking(search: Search, settings: Settings, values: Mapping[str, Value]) -> dict[str, float]:
    """Return the share by which the loops are below each margin that is asked for, at most 0 if
    they are not.
    """
    from control.margins import margins
    from extensions.campaigns.closed_loop import changed

    found = {k: v for name, one in values.items() for k, v in settings.resolved(name, one).items()}
    parameters: Any = changed(settings.parameters, found)
    loops = margins(parameters.control, parameters.model.motor_time_constant)
    least = {
        "delay_margin": min(one.delay for one in loops),
        "phase_margin": min(one.phase for one in loops),
    }
    return {name: 1.0 - least[name] / wanted for name, wanted in search.margins.items()}


@dataclass
class SearchWork(Work):
    """The flights of a search: those of the next trials follow from the rows of the last ones."""

    rows: dict[int, Row] = field(default_factory=dict)
    _needed: set[int] = field(default_factory=set)
    _course: Iterator[list[int]] | None = None

    def __post_init__(self) -> None:
        """Find the first flights that have no row yet."""
        search = self.folder.plan.plan.search
        assert search is not None
        self.search = search
        self.todo = []
        self.rows = {}
        if self.folder.count():
            self.rows = search_rows(self.folder.table(), search)
        self._course = self._trials()
        self._advance()

    def finished(self, outcomes: Sequence[Outcome]) -> None:
        """Take the outcomes of a task; find the next flights when a round of trials is flown."""
        for one in outcomes:
            values = tuple(one.metrics.get(name, float("nan")) for name in self.search.metrics)
            self.rows[one.index] = Row(one.verdict == "passed", values)
            self._needed.discard(one.index)
        super().finished(outcomes)
        if not self._needed:
            self._advance()

    def _advance(self) -> None:
        assert self._course is not None
        for needed in self._course:
            new = [index for index in needed if index not in self.rows]
            if new:
                self._needed = set(new)
                self.todo = [*self.todo, *new]
                return
        self._needed = set()

    # ------------------------------------------------------------------ the course
    def _trials(self) -> Iterator[list[int]]:
        """Yield the flights that are needed, until the search is over."""
        search, settings = self.search, Settings(self.folder.plan, self.folder.cells)
        study = new_study(search, self.folder.plan.plan.seed, defaults(search, settings))
        proposals = distributions(search)
        number = 0
        while number < search.trials:
            count = min(search.together, search.trials - number)
            asked = {number + k: study.ask(proposals) for k in range(count)}
            self._keep({k: dict(one.params) for k, one in asked.items()})
            alive = dict(asked)
            for k, trial in asked.items():
                lacks = lacking(search, settings, trial.params) if search.margins else {}
                if any(one > 0.0 for one in lacks.values()):
                    _tell(study, trial, Judged((), lacks, "margin"), search)
                    del alive[k]
            for seeds in rounds(self.folder.plan.plan.seeds):
                yield [i for k in alive for i in self.folder.cells.of_trial(k, seeds)]
                for k, trial in list(alive.items()):
                    if self._is_over(study, trial, k, seeds):
                        del alive[k]
            number += count
            self._check_metrics()
        self._keep({}, is_over=True)

    def _keep(self, proposed: Mapping[int, dict[str, Value]], *, is_over: bool = False) -> None:
        self.folder.check_there()
        keep_trials(self.folder.path, self.folder.cells.trials, proposed, is_over=is_over)

    def _is_over(self, study: Study, trial: Trial, number: int, seeds: int) -> bool:
        """Judge a trial after so many seeds; tell the sampler if it needs no more."""
        from optuna.trial import TrialState

        flown = self.folder.cells.of_trial(number, seeds)
        judged = judge(self.search, [self.rows[index] for index in flown])
        is_whole = seeds == self.folder.plan.plan.seeds
        if is_whole or judged.reason:
            _tell(study, trial, judged, self.search)
            return True
        if len(self.search.aims) == 1:
            trial.report(judged.values[0], seeds)
            if trial.should_prune():
                study.tell(trial, state=TrialState.PRUNED)
                return True
        return False

    def _check_metrics(self) -> None:
        """Raise UsageError for metrics that no flight has, though some flights passed."""
        passed = [one.values for one in self.rows.values() if one.is_passed]
        for k, name in enumerate(self.search.metrics):
            if passed and all(values[k] != values[k] for values in passed):
                raise UsageError(f"search: no flight has the metric {name!r}; correct the plan")


def rounds(seeds: int) -> list[int]:
    """Return after how many seeds a trial is judged: 1, 2, 4 … and all."""
    found = [1]
    while 2 * found[-1] < seeds:
        found.append(2 * found[-1])
    return found if found[-1] == seeds else [*found, seeds]


def _tell(study: Study, trial: Trial, judged: Judged, search: Search) -> None:
    if search.sampler in ("tpe", "nsga2"):  # the others know no constraints
        for name, value in judged.lacks.items():
            trial.set_constraint(name, value)
    study.tell(trial, judged.values_told(len(search.aims)))
