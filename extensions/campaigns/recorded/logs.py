"""Plans over recorded flights: each log in each cell is a row, judged or replayed instead of flown.

The list of logs is the slowest factor and is kept with the campaign, so that logs that are recorded
later are further rows of it.
"""

from __future__ import annotations

import glob
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from console.atomic_file import replacing
from console.catalogue.catalogue import runs_in
from console.evaluation.result import Result
from extensions.campaigns.factors import Value
from quadrotor.errors import StorageError, UsageError, os_errors
from quadrotor.extension import Function
from quadrotor.extensions import registry
from quadrotor.parameters import Parameters

if TYPE_CHECKING:
    from console.experiments.client import Client
    from extensions.campaigns.plan import Plan

LOG = "log"
"""The factor, and column, with the logs' paths."""
EXPLANATION, REPLAY = "explanation", "replay"
KINDS = (EXPLANATION, REPLAY)
KEPT = "logs.json"
"""File of a campaign with the logs of its rows, in their order."""
ENGINE_ONLY = (
    "vehicles", "board", "law", "true_state", "faults", "keep", "search", "correlations", "plugins",
)  # fmt: skip
"""Parts of a plan that a recorded flight cannot have."""
Figures = tuple[str, str, dict[str, float], tuple[str, ...], float]
"""Verdict, reason, metrics, judged metrics, and s of processor time elsewhere."""


def check_fits(plan: Plan) -> None:
    """Raise ValueError for a plan over logs with parts of simulated flights, and the reverse."""
    if not plan.logs:
        if plan.experiment in KINDS:
            raise ValueError(f'experiment = "{plan.experiment}" needs logs = "…", which it reads')
        return
    if plan.experiment not in KINDS:
        known = " or ".join(f'"{one}"' for one in KINDS)
        raise ValueError(f"logs: experiment = {plan.experiment!r} reads none; it must be {known}")
    if alien := [name for name in ENGINE_ONLY if name in plan.model_fields_set]:
        raise ValueError(f"logs: a recorded flight has no {', '.join(alien)}; remove it")
    if plan.seeds > 1 or plan.design not in ("grid", "zip", "one_at_a_time"):
        raise ValueError("logs: a recorded flight is there once: seeds = 1, and no samples")
    if plan.design != "grid" and plan.factors:
        raise ValueError(f'logs: design = "{plan.design}" is not for logs; take "grid"')
    if plan.experiment == EXPLANATION and (plan.factors or plan.fixed or plan.estimator):
        raise ValueError("logs: an explanation has no parameters; remove fixed and factors")
    if LOG in plan.factors:
        raise ValueError(f"factors.{LOG}: it is the factor that logs = {plan.logs!r} makes")


def expanded(plan: Plan, folder: Path, kept: Path | None) -> Plan:
    """Return the plan with the logs as its slowest factor.

    Args:
        folder: the one to which the pattern is relative.
        kept: that of a campaign with the list of its logs, None to look for them.

    Raises UsageError without any log, StorageError if the list cannot be read.
    """
    if kept is None:
        found = [str(one) for one in _found(folder, plan.logs)]
        if not found:
            raise UsageError(
                f"logs: nothing in {folder.absolute()} matches {plan.logs!r}; name .mcap files or "
                'folders of runs, as logs = "runs/*"'
            )
    else:
        found = read_kept(kept)
    return plan.model_copy(update={"factors": {LOG: found, **plan.factors}})


def _found(folder: Path, pattern: str) -> list[Path]:
    places = [Path(one).absolute() for one in glob.glob(str(folder / Path(pattern).expanduser()))]
    runs = {run for parent in {one.parent for one in places} for run in runs_in(parent)}
    return sorted(runs.intersection(places))


def read_kept(own: Path) -> list[str]:
    """Return the logs of a campaign. Raises StorageError."""
    with os_errors(lambda why: f"the logs of {own.parent} cannot be read ({why})"):
        found: list[str] = json.loads((own / KEPT).read_text())
    return found


def keep(own: Path, logs: Sequence[Value]) -> None:
    """Write the list of logs. Raises OSError."""
    own.mkdir(parents=True, exist_ok=True)
    with replacing(own / KEPT) as new:
        new.write_text(json.dumps(list(logs), indent=1))


def with_later(kept: Sequence[str], now: Sequence[Value]) -> list[str]:
    """Return the logs of a campaign, followed by logs that were added since."""
    known = set(kept)
    return [*kept, *(str(one) for one in now if one not in known)]


class LogReader:
    """A reader of logs that stands in the place of an experiment."""

    planned = 0.0

    def __init__(self, name: str) -> None:
        self.name, self.parameters = name, Parameters()

    def check(self) -> None:
        """Raise UsageError without the extension that reads."""
        _door(self.name)

    def fly(self, client: Client) -> None:
        """Raise UsageError: nothing is flown."""
        raise UsageError(f"{self.name} flies nothing")

    def evaluate(self, log: Path) -> Result:
        """Raise UsageError: only `read` judges."""
        raise UsageError(f"{self.name} is read by quadlab campaign only")


def _door(kind: str) -> Callable[..., dict[str, float]]:
    name, extension = {EXPLANATION: ("levels", "explanation"), REPLAY: ("replayed", "offline")}[
        kind
    ]
    found = registry().offers(Function).get(name)
    if found is None:
        raise UsageError(f"{kind} needs the extension {extension}, which is not installed")
    door: Callable[..., dict[str, float]] = found.load()
    return door


def read(plan: Plan, log: Path, words: Sequence[str]) -> Figures:
    """Return the figures of a log. Raises QuadlabError.

    A replay passes if the plan has limits for it, which are applied later. An explanation passes if
    nothing is found; else the heaviest finding is the reason, and each kind has its weight.
    """
    if not log.exists():
        raise StorageError(f"the log {log} is no longer there")
    if plan.experiment == REPLAY:
        verdict = "passed" if plan.limits else "not_judged"
        return verdict, "", _door(REPLAY)(log, words), (), 0.0
    from console.evaluation.findings import explain
    from flight_log.attached import parameters_of
    from flight_log.run import read_run

    run = read_run(log)
    found = explain(run.topics, parameters_of(run.log.attachments.get("parameters.json")))
    metrics = {"start_s": 1e-9 * run.start_ns, "duration_s": run.duration}
    metrics |= _door(EXPLANATION)(run)
    metrics |= {f"weight_{one.kind}": one.weight for one in reversed(found)}
    verdict, reason = ("failed", found[0].text) if found else ("passed", "")
    return verdict, reason, metrics, (), 0.0
