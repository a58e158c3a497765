"""Settings of the arena's entries that campaigns found, all by one budget."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING

from extensions.laws.arena.cells import Entry
from quadrotor.errors import UsageError
from quadrotor.extension import Function
from quadrotor.extensions import registry

if TYPE_CHECKING:
    import pyarrow as pa

PLANS = Path(__file__).parent
AIM = "position_rms_m"
OWN = "control."
"""Beginning of the names of searched parameters; other columns are conditions."""


@dataclass(frozen=True)
class Found:
    """The best trial of a search.

    Attributes:
        values: by the name of the parameter.
        trials: number of trials. flights: number of flights of a whole trial.
    """

    values: dict[str, float]
    trials: int
    flights: int


def best_trial(rows: pa.Table) -> Found | None:
    """Return the trial with the smallest mean error of those whose flights are all there and
    passed, or None.
    """
    names = [name for name in rows.column_names if name.startswith(OWN)]
    flown: dict[tuple[float, ...], list[float]] = defaultdict(list)
    columns = [rows[name].to_pylist() for name in (*names, "verdict", AIM)]
    for *values, verdict, error in zip(*columns, strict=True):
        flown[tuple(values)].append(error if verdict == "passed" else float("inf"))
    whole = max(map(len, flown.values()))
    key = min(
        flown, key=lambda one: fmean(flown[one]) if len(flown[one]) == whole else float("inf")
    )
    if len(flown[key]) < whole or fmean(flown[key]) == float("inf"):
        return None
    return Found(dict(zip(names, key, strict=True)), len(flown), whole)


def tuned(entries: Sequence[Entry], folder: Path) -> tuple[list[Entry], str]:
    """Return entries with the settings of the campaigns `tune_NAME` in a folder, and their budget:
    one for all, or that of each law where they differ.

    Raises UsageError for a law of a file, and for a campaign that is missing or has no whole trial;
    StorageError for a campaign that cannot be read.
    """
    door = registry().offers(Function).get("campaign")
    if door is None:
        raise UsageError("--tuned needs the extension campaigns, which is not installed")
    made, budgets = [], defaultdict[str, list[str]](list)
    for one in entries:
        if one.own:
            raise UsageError(
                f"--tuned: {one.name} is of a file, and campaigns of compiled flights have none of "
                "these; leave it out of --laws"
            )
        plan = f"tune_{one.name}"
        if not (folder / plan).is_dir():
            raise UsageError(
                f"--tuned {folder} has no campaign {plan}; fly it: quadlab campaign run "
                f"{PLANS / plan}.toml --out {folder / plan}"
            )
        found = best_trial(door.load()(folder / plan))
        if found is None:
            raise UsageError(
                f"{folder / plan}: no trial passed all its flights; widen the ranges of its plan, "
                "or resume it"
            )
        own = {name.removeprefix(OWN): value for name, value in found.values.items()}
        made.append(replace(one, settings={**one.settings, **own}))
        budgets[f"{found.trials} trials of {found.flights} flights"].append(one.name)
    if len(budgets) == 1:
        return made, next(iter(budgets))
    return made, "; ".join(f"{budget} ({', '.join(names)})" for budget, names in budgets.items())
