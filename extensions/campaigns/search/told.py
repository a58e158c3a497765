"""The outcome of a search: the best trial or the Pareto front, and why others failed."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from extensions.campaigns.factors import Value
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.search.plan import Search
from extensions.campaigns.search.trial import Row, front, judge
from extensions.campaigns.settings import word
from extensions.campaigns.table import is_verdict, numbers

if TYPE_CHECKING:
    import pyarrow as pa


UNITS = {"delay_margin": " s of delay", "phase_margin": "° of phase"}
"""Units of the margins of the loops."""


@dataclass(frozen=True)
class TrialRow:
    """A trial of a search that has flights.

    Attributes:
        flights: how many are flown. values: of the aims; empty for a trial that is not whole.
        reason: why it is not feasible, or not whole; empty if it is both.
    """

    number: int
    parameters: dict[str, Value]
    flights: int
    values: tuple[float, ...]
    reason: str


@dataclass(frozen=True)
class SearchOutcome:
    """The trials of a search so far.

    Attributes:
        best: numbers of the best trial, or of those on the Pareto front; empty if none is feasible.
        unflown: trials that needed no flight to be refused, by the margins of their loops.
    """

    search: Search
    trials: list[TrialRow]
    best: list[int]
    unflown: int

    def of(self, number: int) -> TrialRow:
        return next(one for one in self.trials if one.number == number)


def outcome(folder: CampaignFolder, table: pa.Table | None) -> SearchOutcome:
    """Return the outcome of a search, as far as its rows tell."""
    search, cells = folder.plan.plan.search, folder.cells
    assert search is not None
    rows = {} if table is None else search_rows(table, search)
    seeds = folder.plan.plan.seeds
    trials = []
    for number, parameters in cells.trials.items():
        found = [rows[k] for k in cells.of_trial(number, seeds) if k in rows]
        if not found:
            continue
        judged = judge(search, found)
        is_whole = len(found) == len(cells.of_trial(number, seeds))
        reason = judged.reason or ("" if is_whole else f"ended after {len(found)} flights")
        values = judged.values if is_whole and not judged.reason else ()
        trials.append(TrialRow(number, parameters, len(found), values, reason))
    feasible = [one for one in trials if one.values]
    best = [feasible[k].number for k in front([one.values for one in feasible])]
    if len(search.aims) == 1:
        best = best[:1]  # the first of equal ones
    return SearchOutcome(search, trials, best, len(cells.trials) - len(trials))


def search_rows(table: pa.Table, search: Search) -> dict[int, Row]:
    """Return the columns of the rows that a search needs, by the index of their flight."""
    passed = is_verdict(table, "passed")
    values = np.full((table.num_rows, len(search.metrics)), np.nan)
    for k, name in enumerate(search.metrics):
        if name in table.column_names:
            values[:, k] = numbers(table, name)
    found = zip(table["index"].to_pylist(), passed.tolist(), values.tolist(), strict=True)
    return {index: Row(is_passed, tuple(numbers)) for index, is_passed, numbers in found}


def none_feasible(found: SearchOutcome) -> str:
    """Return a line that says why no trial is feasible."""
    kinds = Counter(one.reason.lstrip("0123456789 ") for one in found.trials if one.reason)
    why = [f"{reason} ({count} trials)" for reason, count in kinds.most_common(3)]
    margins = found.search.margins
    wanted = [f"{margins[name]:g}{unit}" for name, unit in UNITS.items() if name in margins]
    why += [f"a margin below {' or '.join(wanted)} ({found.unflown} trials)"] * (found.unflown > 0)
    total = len(found.trials) + found.unflown
    return f"none of {total} trials is feasible: {'; '.join(why)}; widen the search, or its limits"


def told_plan(search: Search) -> list[str]:
    """Return a description of a search, as lines of text."""
    lines = [
        f"  search by {search.sampler}: {search.trials} trials, {search.together} at once; "
        f"{search.aggregate} {', '.join(search.aims)} as small as can be"
    ]
    for name, one in search.parameters.items():
        if isinstance(one, list):
            lines.append(f"  {name}: one of {', '.join(map(str, one))}")
        else:
            lines.append(f"  {name}: {one.low:g} … {one.high:g}{', logarithmic' * one.log}")
    return lines


def told(found: SearchOutcome) -> list[str]:
    """Return the outcome of a search as lines of text."""
    search = found.search
    whole = sum(bool(one.values) for one in found.trials)
    ended = sum(one.reason.startswith("ended after") for one in found.trials)
    bad = len(found.trials) - whole - ended + found.unflown
    head = f"  {len(found.trials) + found.unflown} trials: {whole} whole and feasible, "
    lines = [f"{head}{ended} ended early, {bad} not feasible"]
    if not found.best:
        return [*lines, f"  {none_feasible(found)}"]
    first = next((one for one in found.trials if one.number == 0), None)
    name = "best" if len(search.aims) == 1 else "on the Pareto front"
    for number in found.best[:20]:
        one = found.of(number)
        lines.append(f"  {name}: trial {number}: {_values(search, one)}")
        lines += [f"    --set {word(key, value)}" for key, value in one.parameters.items()]
    if first is not None and first.values and len(search.aims) == 1:
        ratio = found.of(found.best[0]).values[0] / first.values[0]
        lines.append(f"  trial 0: {_values(search, first)}; the best is {ratio:.3g} × that")
    return lines


def _values(search: Search, one: TrialRow) -> str:
    named = zip(search.aims, one.values, strict=True)
    return ", ".join(f"{search.aggregate} {name} {value:.5g}" for name, value in named)


def facts(found: SearchOutcome) -> dict[str, object]:
    """Return the outcome of a search as JSON has it."""
    return {
        "aims": found.search.aims,
        "best": found.best,
        "refused_unflown": found.unflown,
        "trials": [
            {
                "trial": one.number,
                "parameters": one.parameters,
                "flights": one.flights,
                "values": list(one.values),
                "reason": one.reason,
            }
            for one in found.trials
        ],
    }
