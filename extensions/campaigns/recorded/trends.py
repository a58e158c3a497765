"""Figures of recorded runs over time: of their reports, and of campaigns over their logs."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from console.catalogue.search import RunSearch
from console.catalogue.tags import tags_of
from console.runs.report_folders import has_report, read_result
from extensions.campaigns.beginning import RECORD
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.recorded.logs import EXPLANATION, LOG
from extensions.campaigns.table import Facts, metric_columns, numbers
from quadrotor.errors import QuadlabError

if TYPE_CHECKING:
    from console.catalogue.catalogue import Catalogue

DAY = 86_400.0
PACK = "battery"
"""How the tags begin that name the battery pack of a run, as in "battery 3"."""
GROUPS = ("all", "vehicle", PACK, "tag")
MOST_RUNS = 5_000
FEWEST = 4
"""Runs that a slope needs."""


@dataclass(frozen=True)
class RunFigures:
    """The figures of one run.

    Attributes:
        start: s, epoch.
    """

    run: str
    start: float
    vehicle: str
    tags: tuple[str, ...] = ()
    metrics: Mapping[str, float] = field(default_factory=dict)

    def groups(self, by: str) -> tuple[str, ...]:
        """Return the groups to which the run belongs; none without a tag of that kind."""
        if by == "vehicle":
            return (self.vehicle,)
        if by == PACK:
            return tuple(one for one in self.tags if one.lower().startswith(PACK))
        return self.tags if by == "tag" else ("all",)


def recorded(catalogue: Catalogue, search: RunSearch, campaigns: Path) -> list[RunFigures]:
    """Return the figures of the runs that a search finds, oldest first.

    Args:
        campaigns: folder of campaigns; those over logs add the figures of their rows.
    """
    entries = catalogue.runs(search, limit=MOST_RUNS)[::-1]
    tags = tags_of(catalogue, [one.id for one in entries])
    of_logs = read_campaigns(campaigns)
    found = []
    for one in entries:
        log = catalogue.folder / Path(one.file).name
        metrics = {**of_logs.get(log.name, {}), **_reported(log)}
        mine = tuple(tags.get(one.id, ()))
        found.append(RunFigures(one.id, 1e-9 * one.start_ns, one.vehicle, mine, metrics))
    return found


def _reported(log: Path) -> dict[str, float]:
    """Return the metrics of a run's report, none if it has none that can be read."""
    if not has_report(log):
        return {}
    try:
        metrics = read_result(log).get("metrics")
    except QuadlabError:  # the list of runs shows it as unreadable
        return {}
    known = metrics.items() if isinstance(metrics, dict) else ()
    return {name: float(value) for name, value in known if isinstance(value, int | float)}


def read_campaigns(place: Path) -> dict[str, dict[str, float]]:
    """Return the figures of explained logs by the names of the logs; a newer campaign counts."""
    found: dict[str, dict[str, float]] = defaultdict(dict)
    for record in sorted(place.glob(f"*/{RECORD}"), key=lambda one: one.stat().st_mtime):
        try:
            folder = CampaignFolder(record.parent)
            if folder.record["experiment"] != EXPLANATION or not folder.count():
                continue
            table = folder.table(figures_only=True)
        except QuadlabError:  # the list of campaigns shows its problem
            continue
        names = [Path(one).name for one in table[LOG].to_pylist()]
        for metric in metric_columns(table, folder.plan.plan.varied):
            for name, value in zip(names, numbers(table, metric).tolist(), strict=True):
                if math.isfinite(value):
                    found[name][metric] = value
    return found


def trends(runs: Sequence[RunFigures], metric: str, by: str) -> Facts:
    """Return a metric over time for each group, with its slope.

    A slope is Theil and Sen's, a day, with its interval at 95 %: single runs that went wrong do
    not turn it. Within a group of a battery pack `number` counts the flights with this pack.
    """
    names = sorted({name for one in runs for name in one.metrics})
    metric = metric if metric in names else _usual(names)
    members: dict[str, list[RunFigures]] = defaultdict(list)
    for one in runs:
        for group in one.groups(by):
            members[group].append(one)
    series = [_series(name, found, metric) for name, found in sorted(members.items())]
    return {
        "metrics": names,
        "metric": metric,
        "by": by,
        "groups": list(GROUPS),
        "series": [one for one in series if one["points"]],
    }


def _usual(names: Iterable[str]) -> str:
    known = list(names)
    return next((one for one in known if one == "position_rms_m"), known[0] if known else "")


def _series(name: str, runs: Sequence[RunFigures], metric: str) -> Facts:
    known = [
        (number, one)
        for number, one in enumerate(runs, 1)
        if math.isfinite(one.metrics.get(metric, math.nan))
    ]
    points = [
        {"run": one.run, "time": one.start, "value": one.metrics[metric], "number": number}
        for number, one in known
    ]
    times, values = [one.start for _, one in known], [one.metrics[metric] for _, one in known]
    return {"name": name, "points": points, **_slope(times, values)}


def _slope(times: Sequence[float], values: Sequence[float]) -> Facts:
    """Return the slope a day with its interval, None from too few runs or at a single moment."""
    from scipy.stats import theilslopes

    if len(times) < FEWEST or times[0] == times[-1]:
        return {"slope": None}
    days = (np.array(times) - times[0]) / DAY
    slope, _, low, high = theilslopes(np.array(values), days)
    return {"slope": float(slope), "interval": [float(low), float(high)]}
