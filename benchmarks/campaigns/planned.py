"""Plans of this folder as benchmarks: campaigns fly them, and their cells are a table."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from benchmarks.harness import Row, Size
from console.experiments.client import Experiment
from extensions.campaigns.design import Cells
from extensions.campaigns.engines.local_engine import fly_locally
from extensions.campaigns.engines.work import Work
from extensions.campaigns.flights import fly_task
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.plan import parse_plan
from extensions.campaigns.settings import Settings
from extensions.campaigns.shard import WHOLE
from extensions.campaigns.summary import command_of
from extensions.campaigns.table import numbers
from quadlab.simulated.experiment import chosen as experiment_of
from quadlab.simulated.experiment import fly
from quadrotor.records import Array

PLANS = Path(__file__).parent / "plans"
QUICK_SEEDS = 2


class Flown:
    """The flights of a plan of this folder.

    Args:
        name: of the plan's file.
        size: a quick run has few seeds, a smoke run flies its first cells once, here.
        flights: at least so many, by the number of seeds; 0 for those of the plan.
        seeds: of each cell in a quick run.
        smoke: cells of a smoke run. short: values of fixed settings with which it is short.
    """

    def __init__(
        self,
        name: str,
        size: Size,
        *,
        flights: int = 0,
        seeds: int = QUICK_SEEDS,
        smoke: int = 2,
        short: Mapping[str, float] = {},
    ) -> None:
        path = PLANS / f"{name}.toml"
        text = path.read_text()
        chosen = size.of(0, seeds, 1)
        if flights:
            chosen = math.ceil(flights / Cells(parse_plan(text, path).plan).number)
        if chosen:
            text = re.sub(r"^seeds = \d+$", f"seeds = {chosen}", text, flags=re.MULTILINE)
        for setting, value in short.items() if size is Size.SMOKE else ():
            text = re.sub(
                rf'^"{setting}" = .*$', f'"{setting}" = {value}', text, flags=re.MULTILINE
            )
        file = parse_plan(text, path)
        self.plan = file.plan
        with TemporaryDirectory(prefix="quadlab-plan-") as made:
            folder = CampaignFolder.begun(Path(made, name), file, Cells(file.plan))
            if size is Size.SMOKE:
                folder.add(fly_task(folder.task(range(min(smoke, folder.flights)))), WHOLE)
            else:
                work = Work(folder, WHOLE, range(folder.flights))
                fly_locally(work, os.cpu_count() or 1)
                work.write()
                folder.finish()
            self.table = folder.table()
        self._settings = Settings(file, Cells(file.plan))

    def values(self, metric: str, **factors: Any) -> Array:
        """Return a metric of the flights with these values of factors; infinite for one without."""
        chosen = self._chosen(factors)
        if metric not in self.table.column_names:
            return np.full(int(chosen.sum()), np.inf)
        found: Array = numbers(self.table, metric)[chosen]
        return np.where(np.isfinite(found), found, np.inf)

    def metrics(self, **factors: Any) -> set[str]:
        """Return the metrics that a flight with these values of factors has."""
        columns = self.table.filter(pa.array(self._chosen(factors)))
        return {name for name in columns.column_names if columns[name].null_count < len(columns)}

    def count(self, metric: str, **factors: Any) -> int:
        """Return the number of flights of which a metric is 1: of which it is true."""
        return int((self.values(metric, **factors) == 1.0).sum())

    def _chosen(self, factors: Mapping[str, Any]) -> npt.NDArray[np.bool_]:
        chosen = np.ones(self.table.num_rows, bool)
        for name, value in factors.items():
            chosen &= np.array(self.table[name].to_pylist()) == value
        return chosen

    def notes(self, wanted: npt.NDArray[np.bool_], what: str = "") -> list[str]:
        """Return lines on some flights: what they did, and the command that flies each again."""
        indices, reasons = self.table["index"].to_pylist(), self.table["reason"].to_pylist()
        return [
            f"{reasons[k] or what}: `{command_of(self._settings, indices[k])}`"
            for k in np.flatnonzero(wanted)
        ]

    def again(self, row: int) -> Experiment:
        """Fly the flight of a row again; return its experiment, with what that has kept."""
        index, file = self.table["index"][row].as_py(), self._settings.file
        experiment = experiment_of(file.experiment)
        with TemporaryDirectory(prefix="quadlab-again-") as made:
            fly(
                experiment,
                seed=self._settings.cells.seed(index),
                words=self._settings.words(index // self.plan.seeds),
                out=Path(made),
                board=self.plan.board,
            )
        return experiment

    def combinations(self, *factors: str) -> list[tuple[Any, ...]]:
        """Return the combinations of values of some factors that were flown, in their order."""
        columns = (self.table[name].to_pylist() for name in factors)
        return list(dict.fromkeys(zip(*columns, strict=True)))

    def rows(self, down: str, across: str, metric: str, unit: float, symbol: str) -> list[Row]:
        """Return a row for each value of a factor, with the median and the worst value of a metric
        for each value of another.

        Args:
            unit: of the table in that of the metric, as 1e3 for mm of m. symbol: its name.
        """
        found: dict[str, Row] = {}
        for one, other in self.combinations(down, across):
            values = unit * self.values(metric, **{down: one, across: other})
            figures = found.setdefault(one, Row(one, {})).figures
            figures[f"{other}, {symbol}"] = float(np.median(values))
            figures[f"{other}, worst"] = float(values.max())
        return list(found.values())
