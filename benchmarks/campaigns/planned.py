"""Plans of this folder as benchmarks: campaigns fly them, and their cells are a table."""

from __future__ import annotations

import os
import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.harness import Row, Size
from extensions.campaigns.design import Cells
from extensions.campaigns.engines.local_engine import fly_locally
from extensions.campaigns.engines.work import Work
from extensions.campaigns.flights import fly_task
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.plan import parse_plan
from extensions.campaigns.shard import WHOLE
from extensions.campaigns.table import numbers
from quadrotor.records import Array

PLANS = Path(__file__).parent / "plans"
QUICK_SEEDS = 2


class Flown:
    """The flights of a plan of this folder.

    Args:
        name: of the plan's file.
        size: a quick run has few seeds, a smoke run flies the first two cells once, here.
    """

    def __init__(self, name: str, size: Size) -> None:
        path = PLANS / f"{name}.toml"
        text = path.read_text()
        if size is not Size.FULL:
            seeds = size.of(0, QUICK_SEEDS, 1)
            text = re.sub(r"^seeds = \d+$", f"seeds = {seeds}", text, flags=re.MULTILINE)
        file = parse_plan(text, path)
        self.plan = file.plan
        with TemporaryDirectory(prefix="quadlab-plan-") as made:
            folder = CampaignFolder.begun(Path(made, name), file, Cells(file.plan))
            if size is Size.SMOKE:
                folder.add(fly_task(folder.task([0, 1])), WHOLE)
            else:
                work = Work(folder, WHOLE, range(folder.flights))
                fly_locally(work, os.cpu_count() or 1)
                work.write()
                folder.finish()
            self.table = folder.table()

    def values(self, metric: str, **factors: Any) -> Array:
        """Return a metric of the flights with these values of factors; infinite for one without."""
        chosen = np.ones(self.table.num_rows, bool)
        for name, value in factors.items():
            chosen &= np.array(self.table[name].to_pylist()) == value
        found: Array = numbers(self.table, metric)[chosen]
        return np.where(np.isfinite(found), found, np.inf)

    def pairs(self, first: str, second: str) -> list[tuple[Any, Any]]:
        """Return the pairs of values of two factors that were flown, in their order."""
        columns = (self.table[name].to_pylist() for name in (first, second))
        return list(dict.fromkeys(zip(*columns, strict=True)))

    def rows(self, down: str, across: str, metric: str, unit: float, symbol: str) -> list[Row]:
        """Return a row for each value of a factor, with the median and the worst value of a metric
        for each value of another.

        Args:
            unit: of the table in that of the metric, as 1e3 for mm of m. symbol: its name.
        """
        found: dict[str, Row] = {}
        for one, other in self.pairs(down, across):
            values = unit * self.values(metric, **{down: one, across: other})
            figures = found.setdefault(one, Row(one, {})).figures
            figures[f"{other}, {symbol}"] = float(np.median(values))
            figures[f"{other}, worst"] = float(values.max())
        return list(found.values())
