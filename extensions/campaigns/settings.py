"""The parameters of each cell, checked before the first flight."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from extensions.campaigns.cases import settled
from extensions.campaigns.design import Cells
from extensions.campaigns.factors import Distribution, Range, Value
from extensions.campaigns.plan import COMPILED, PlanFile
from extensions.campaigns.recorded import logs as over_logs
from quadrotor.errors import ParameterError, QuadlabError, UsageError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore

if TYPE_CHECKING:
    from console.experiments.client import Experiment
    from quadlab.simulated.parameters import FlightParameters


def word(name: str, value: Value) -> str:
    """Return a setting as `quadlab fly --set` takes it."""
    return f"{name}={text_of(value)}"


def text_of(value: Value) -> str:
    """Return a value as a text from which the same value is read."""
    return str(value).lower() if isinstance(value, bool) else str(value)


@dataclass
class Settings:
    """The parameters of the flights of a plan.

    Raises UsageError for an unknown experiment, board or fixed parameter.
    """

    file: PlanFile
    cells: Cells

    @cached_property
    def experiment(self) -> Experiment:
        from extensions.campaigns.closed_loop import ClosedLoop
        from quadlab.simulated.experiment import chosen

        if self.file.plan.experiment == COMPILED:
            return ClosedLoop()
        if self.file.plan.logs:
            return over_logs.LogReader(self.file.plan.experiment)
        try:
            return chosen(self.file.experiment)
        except UsageError as error:
            others = f"{COMPILED}, or over logs {' and '.join(over_logs.KINDS)}"
            raise UsageError(f"{error}, or {others}") from None

    @cached_property
    def parameters(self) -> FlightParameters:
        """Return the parameters that all flights share."""
        from quadlab.data_folder import data_folder
        from quadlab.simulated.experiment import flight_parameters
        from vehicle.boards.kind import find_kind
        from vehicle.estimators.offer import offer_plugins
        from vehicle.processes.config import PLUGINS

        plan = self.file.plan
        offer_plugins(self.file.plugins or data_folder(None) / PLUGINS)
        try:
            return flight_parameters(self.experiment, find_kind(plan.board), 1, self._shared())
        except UsageError as error:
            said = str(error).replace("--set ", "fixed: ", 1).replace("--set: ", "", 1)
            raise UsageError(said.replace("--board ", "board: ", 1)) from None

    def _shared(self) -> list[str]:
        plan = self.file.plan
        words = [word(name, value) for name, value in plan.fixed.items()]
        words += [word("control.law", plan.law)] if plan.law else []
        words += [word("estimation.estimator", plan.estimator)] if plan.estimator else []
        return [*words, *([word("faults", plan.faults)] if plan.faults else [])]

    def words(self, cell: int) -> list[str]:
        """Return the words of `--set` of a cell's flights."""
        factors = self.cells.factors(cell)
        factors.pop(over_logs.LOG, None)
        cases = self.file.plan.cases
        each = [settled(cases, name, value) for name, value in factors.items()]
        return [*self._shared(), *(word(*one) for settings in each for one in settings.items())]

    def log(self, cell: int) -> tuple[Path, list[str]]:
        """Return the log that a cell of a plan over logs reads, and its words of `--set`."""
        return Path(str(self.cells.factors(cell)[over_logs.LOG])), self.words(cell)

    @cached_property
    def store(self) -> ParameterStore:
        return ParameterStore(self.parameters)

    @cached_property
    def _sets(self) -> Mapping[str, Callable[[str], dict[str, ParameterValue]]]:
        from quadlab.settings import SETS

        return SETS

    @cached_property
    def _known(self) -> dict[tuple[str, str], dict[str, ParameterValue]]:
        return {}

    def resolved(self, name: str, value: Value) -> dict[str, ParameterValue]:
        """Return the values for which a factor's value stands. Raises ParameterError."""
        from quadlab.settings import setting

        if isinstance(value, float):  # most are different
            return setting(self.store, self._sets, name, text_of(value))
        key = name, text_of(value)
        if key not in self._known:
            found: dict[str, ParameterValue] = {}
            for one, wanted in settled(self.file.plan.cases, name, value).items():
                found |= setting(self.store, self._sets, one, text_of(wanted))
            self._known[key] = found
        return self._known[key]

    def values(self, chosen: range) -> Iterator[tuple[int, dict[str, ParameterValue]]]:
        """Yield each of these cells with the values in which it differs from the shared ones.

        Raises UsageError, which names the cell, the factor and what is allowed.
        """
        names = [name for name in self.file.plan.varied if name != over_logs.LOG]
        columns = [self.cells.column(name, np.asarray(chosen, np.int64)) for name in names]
        rows: Iterable[tuple[Value, ...]] = (
            zip(*columns, strict=True) if names else itertools.repeat(())
        )
        for cell, row in zip(chosen, rows, strict=False):
            found: dict[str, ParameterValue] = {}
            for name, value in zip(names, row, strict=True):
                try:
                    found |= self.resolved(name, value)
                except ParameterError as error:
                    raise UsageError(self._refused(cell, name, value, str(error))) from None
            yield cell, found

    def _refused(self, cell: int, name: str, value: Value, why: str) -> str:
        if name not in self.file.plan.factors:
            return f"search.parameters: {why}"
        if isinstance(self.file.plan.factors[name], Distribution):
            why += (
                "; the distribution leaves the bounds: narrow it, or take one with ends, as "
                "truncnorm"
            )
        return f"factors: cell {cell}: {why}"

    def check(self) -> None:
        """Check each cell, and what no value shows alone; of a search the ends of its ranges.

        Raises UsageError.
        """
        from vehicle.parameters import ORDERED, check_pairs

        if self.file.plan.search is not None and not self.cells.trials:
            ends = Cells(self.file.plan, dict(enumerate(_ends(self.file.plan.search.parameters))))
            Settings(self.file, ends).check()
            return
        self._check_count()
        _ = self.parameters
        self._check_own(self.experiment)
        paired = {name for pair in ORDERED for name in pair}
        paired |= {"behavior.keep_out", "beacons.layout"}
        step = 65_536
        for first in range(0, self.cells.known, step):
            last = min(first + step, self.cells.known)
            before: dict[str, ParameterValue] = {}
            for cell, found in self.values(range(first, last)):
                for name in found.keys() - before.keys():
                    before[name] = self.store.get(name)
                try:
                    self.store.preset(before | found)
                    if not paired.isdisjoint(found):
                        check_pairs(self.store.values())
                    if any(name.startswith("experiment.") for name in found):
                        self._check_own(self.experiment)
                except QuadlabError as error:
                    raise UsageError(f"cell {cell}: {error}") from None
            self.store.preset(before)

    def _check_count(self) -> None:
        from quadlab.simulated.together import check_count

        if self.file.plan.experiment == COMPILED:
            return
        try:
            check_count(self.experiment, self.file.plan.vehicles)
        except UsageError as error:
            raise UsageError(str(error).replace("--vehicles ", "vehicles = ", 1)) from None

    @staticmethod
    def _check_own(experiment: Experiment) -> None:
        from console.experiments.user_file import errors_with_line

        with errors_with_line(experiment):
            experiment.check()


def _ends(parameters: Mapping[str, list[Value] | Range]) -> list[dict[str, Value]]:
    """Return trials in which each value of a list, and both ends of a range, are once."""
    levels = {
        name: one if isinstance(one, list) else [one.low, one.high]
        for name, one in parameters.items()
    }
    most = max(map(len, levels.values()))
    return [{name: one[min(k, len(one) - 1)] for name, one in levels.items()} for k in range(most)]
