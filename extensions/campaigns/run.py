"""A campaign from its plan to its table: begun or continued, on this computer or by Dask."""

from __future__ import annotations

import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from extensions.campaigns.closed_loop import check_compiled
from extensions.campaigns.design import Cells
from extensions.campaigns.engines.local_engine import fly_locally
from extensions.campaigns.engines.stop import kept_when_stopped
from extensions.campaigns.engines.work import Work
from extensions.campaigns.flights import UNFLOWN, Outcome, fly_task
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.plan import COMPILED, SALTELLI, Plan, PlanFile, read_plan
from extensions.campaigns.search.study import SearchWork, check_library
from extensions.campaigns.search.told import none_feasible, outcome, told_plan
from extensions.campaigns.settings import Settings
from extensions.campaigns.shard import WHOLE, Shard
from extensions.campaigns.table import numbers
from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from pyarrow import Table

SPEED = {True: 4500.0, False: 15.0}
"""Times real time that a worker flies, compiled or not, for the estimate before the first flight.
"""
MOST_WORKERS = 512
PAUSE = 30.0
"""s between two lines of progress where there is no terminal."""


@dataclass(frozen=True)
class Engine:
    """The place of the flights: processes of this computer, or workers of a Dask scheduler."""

    workers: int = 0
    dask: str = ""
    shard: Shard = WHOLE

    def __post_init__(self) -> None:
        """Raise UsageError for a number of workers that cannot be."""
        if self.workers and self.dask:
            raise UsageError("--workers is of this computer, --dask of others: give one of both")
        if not 0 <= self.workers <= MOST_WORKERS:
            raise UsageError(f"--workers {self.workers}: allowed are 1 to {MOST_WORKERS}")

    def check(self) -> None:
        """Raise QuadlabError if it cannot fly, so that nothing is begun."""
        if self.dask:
            from extensions.campaigns.engines.dask_engine import check_scheduler

            check_scheduler(self.dask)

    @property
    def processes(self) -> int:
        return self.workers or os.cpu_count() or 1


def checked(path: Path) -> tuple[PlanFile, Settings]:
    """Return a plan, each row of which can be flown. Raises StorageError, UsageError."""
    file = read_plan(path)
    file.own_files()
    try:
        if file.plan.search is not None:
            check_library("optuna", "search")
        if file.plan.design == SALTELLI:
            check_library("SALib", 'design = "saltelli"')
        settings = Settings(file, Cells(file.plan))
        _ = settings.experiment
        if file.plan.experiment == COMPILED:
            check_compiled(settings)
        settings.check()
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from None
    return file, settings


def told(settings: Settings, processes: int) -> list[str]:
    """Return a text with the flights of a plan and their expected duration."""
    plan, cells = settings.file.plan, settings.cells
    lines = [
        f"{cells.flights} flights of {plan.experiment}: {cells.number} cells ({plan.design}), "
        f"{plan.seeds} seeds each"
    ]
    lines += told_plan(plan.search) if plan.search else []
    for name in plan.factors:
        values = Cells(plan.model_copy(update={"search": None})).column(
            name, np.arange(cells.number)
        )
        distinct = list(dict.fromkeys(values))
        shown = [f"{v:.5g}" if isinstance(v, float) else str(v) for v in distinct]
        if len(shown) > 8:
            shown = [*shown[:3], "…", shown[-1], f"({len(distinct)} values)"]
        lines.append(f"  {name}: {', '.join(shown)}")
    lines += [f"  {name} = {value}" for name, value in plan.fixed.items()]
    if plan.logs:
        return lines
    flown = settings.experiment.planned * cells.flights
    seconds = flown / SPEED[plan.experiment == COMPILED] / processes
    lines.append(
        f"  about {flown / 3600:.3g} h of simulated flight, {duration(seconds)} with {processes} "
        "worker(s) of usual speed"
    )
    return lines


def duration(seconds: float) -> str:
    """Return a duration for people."""
    for limit, unit, size in ((90.0, "s", 1.0), (5400.0, "min", 60.0), (172_800.0, "h", 3600.0)):
        if seconds < limit:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 86_400:.3g} days"


def fly(folder: CampaignFolder, engine: Engine) -> int:
    """Fly all flights that have no row yet; return the exit status.

    It is 1 when a flight raised an error, was too long or killed its workers, as these have no
    figures. Raises QuadlabError; the rows so far are kept, also at Ctrl-C and SIGTERM.
    """
    shard = engine.shard
    if folder.plan.plan.search and shard != WHOLE:
        raise UsageError(
            f"--shard {shard.number}/{shard.of}: a search chooses each trial by those before; use "
            "--workers or --dask"
        )
    with kept_when_stopped(folder.path), folder.owned(shard):
        if shard == WHOLE:
            folder.mend()
        done = folder.done()
        mine = np.arange(folder.flights)[shard.number - 1 :: shard.of]
        todo = mine[~done[mine]].tolist()
        most = "at most " if folder.plan.plan.search else ""
        print(f"{most}{len(todo)} of {len(mine)} flights to fly into {folder.path}", flush=True)
        if todo and not folder.is_whole():
            _fly(folder, engine, todo)
        if shard == WHOLE:
            folder.finish()
            _keep_worst(folder)
        return _ended(folder)


def _fly(folder: CampaignFolder, engine: Engine, todo: list[int]) -> None:
    with _progress(len(todo)) as progress:
        kind = SearchWork if folder.plan.plan.search else Work
        work = kind(folder, engine.shard, todo, progress.took)
        try:
            if engine.dask:
                from extensions.campaigns.engines.dask_engine import fly_by_dask

                fly_by_dask(work, engine.dask)
            else:
                fly_locally(work, engine.processes)
        finally:
            work.write()


def _ended(folder: CampaignFolder) -> int:
    is_search = folder.plan.plan.search is not None
    table = None if is_search and folder.count() == 0 else folder.table()
    counted = Counter([] if table is None else table["verdict"].to_pylist())
    words = [f"{count} {name.replace('_', ' ')}" for name, count in sorted(counted.items())]
    print(f"{counted.total()} of {folder.flights} flights: {', '.join(words) or 'none flown'}")
    print(f"quadlab campaign show {folder.path}")
    if is_search and not (found := outcome(folder, table)).best:
        print(f"quadlab: {none_feasible(found)}", file=sys.stderr)
        return 1
    if table is not None and counted["passed"] and (lost := _lacking(folder.plan.plan, table)):
        print(f"quadlab: no flight has {lost}; correct metrics or limits", file=sys.stderr)
        return 1
    return 1 if any(counted[name] for name in UNFLOWN) else 0


def _lacking(plan: Plan, table: Table) -> str:
    """Return the metrics that a plan keeps, or limits, and no flight has; none that it drops."""
    limited = [name for name in plan.limits if name in plan.metrics or not plan.metrics]
    wanted = dict.fromkeys([*plan.metrics, *limited])
    return ", ".join(repr(name) for name in wanted if name not in table.column_names)


def _keep_worst(folder: CampaignFolder) -> None:
    """Fly those with the largest metric again, and keep their logs: they are the same flights."""
    keep = folder.plan.plan.keep
    if keep.logs != "worst":
        return
    table = folder.table()
    if keep.metric not in table.column_names:
        raise UsageError(f"keep.metric: no flight has the metric {keep.metric!r}")
    values = numbers(table, keep.metric)
    order = [k for k in np.argsort(-values, kind="stable") if np.isfinite(values[k])]
    indices = numbers(table, "index")
    for k in order[: keep.number]:
        index = int(indices[k])
        if not folder.log_of(index).exists():
            (again,) = fly_task(folder.task([index], keep_logs=True))
            folder.add_log(again)


@dataclass
class Progress:
    """Progress of a run; its rate begins with the first task, before which workers start.

    Args:
        total: number of flights. show: shows a line with the number flown.
    """

    total: int
    show: Callable[[int, str], None]
    clock: Callable[[], float] = time.monotonic
    flown: int = 0
    missed: Counter[str] = field(default_factory=Counter)
    first: tuple[float, int] | None = None

    def took(self, outcomes: Sequence[Outcome]) -> None:
        self.flown += len(outcomes)
        self.missed.update(one.verdict for one in outcomes if one.verdict != "passed")
        words = [f"{self.flown} of {self.total}"]
        if self.first is None:
            self.first = self.clock(), self.flown
        else:
            rate = (self.flown - self.first[1]) / max(1e-9, self.clock() - self.first[0])
            words += [f"{rate:.3g} a second"]
            to_go = (self.total - self.flown) / rate
            words += [f"{duration(to_go)} to go"] if self.flown < self.total else []
        words += [f"{n} {name.replace('_', ' ')}" for name, n in sorted(self.missed.items())]
        self.show(self.flown, ", ".join(words))


@contextmanager
def _progress(total: int) -> Iterator[Progress]:
    if not sys.stderr.isatty():
        last = [time.monotonic()]

        def line(flown: int, words: str) -> None:
            if time.monotonic() - last[0] >= PAUSE:
                last[0] = time.monotonic()
                print(words, file=sys.stderr, flush=True)

        yield Progress(total, line)
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Bar

    columns = BarColumn(), TextColumn("{task.description}")
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting workers", total=total)

        def show(flown: int, words: str) -> None:
            bar.update(task, completed=flown, description=words)

        yield Progress(total, show)
