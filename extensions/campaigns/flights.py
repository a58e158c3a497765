"""The flights of a task, in the process of a worker: rows that depend on plan and index alone."""

from __future__ import annotations

import errno
import os
import platform
import shutil
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from extensions.campaigns.design import Cells
from extensions.campaigns.factors import Value
from extensions.campaigns.plan import COMPILED, Plan, parse_plan
from extensions.campaigns.recorded import logs as over_logs
from extensions.campaigns.settings import Settings
from quadrotor.errors import QuadlabError, StorageError

if TYPE_CHECKING:
    from quadrotor.parameter_description import ParameterValue

RAISED, TIMED_OUT, WORKER_DIED = "raised", "timed_out", "worker_died"
"""Verdicts of flights without figures, beside those of `quadlab fly`."""
UNFLOWN = (RAISED, TIMED_OUT, WORKER_DIED)
EXHAUSTED = (
    errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS, errno.ENOMEM, errno.EMFILE,
    errno.ENFILE,
)  # fmt: skip
"""Errors of a computer that has run out of something, on which no row may depend."""


@dataclass(frozen=True, slots=True)
class Task:
    """Flights of a plan, for one worker.

    Attributes:
        text: of the plan.
        folder: that of the campaign, with the files that the plan names.
        needs_stack: whether a whole vehicle flies, for which a worker loads more.
        keep_logs: whether the logs are returned of all flights, beside those that the plan keeps.
        trials: of a search, the values of the trials to which the flights belong.
    """

    text: str
    folder: str
    indices: tuple[int, ...]
    needs_stack: bool = True
    keep_logs: bool = False
    trials: Mapping[int, dict[str, Value]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Outcome:
    """A flight that has ended, in whatever way.

    Attributes:
        judged: metrics that have limits: the smaller the better.
        wall, processor: s.
        log: the log's bytes, if it is kept.
    """

    index: int
    verdict: str
    reason: str = ""
    metrics: Mapping[str, float] = field(default_factory=dict)
    judged: tuple[str, ...] = ()
    wall: float = 0.0
    processor: float = 0.0
    worker: str = ""
    host: str = ""
    log: bytes | None = None


def fly_task(task: Task) -> list[Outcome]:
    """Fly; an error in a flight becomes its outcome.

    Raises StorageError when the computer has no disk, memory or files left: that would be a row
    that depends on the computer, so the flight has none yet.
    """
    settings = _settings(task.text, task.folder)
    settings.cells.trials.update(task.trials)
    if settings.file.plan.experiment == COMPILED:
        return _compiled(settings, task.indices)
    return [_flown(settings, index, task.keep_logs) for index in task.indices]


@lru_cache(maxsize=2)
def _settings(text: str, folder: str) -> Settings:
    file = parse_plan(text, Path(folder) / "plan.toml", is_kept=True)
    return Settings(file, Cells(file.plan))


def _here(outcome: Outcome) -> Outcome:
    """Return an outcome with the name of this worker and its host."""
    return replace(outcome, worker=str(os.getpid()), host=platform.node())


def _flown(settings: Settings, index: int, keep_log: bool) -> Outcome:
    """Fly as `quadlab fly` does with the words of this row."""
    plan = settings.file.plan
    began, processor = time.perf_counter(), time.process_time()
    folder = Path(tempfile.mkdtemp(prefix="quadlab-campaign-"))
    verdict, reason, log = RAISED, "", None
    metrics: dict[str, float] = {}
    judged: tuple[str, ...] = ()
    try:
        if plan.logs:
            done = _read(settings, index)
        else:
            done = (_together if plan.vehicles > 1 else _alone)(settings, index, folder)
        verdict, reason, metrics, judged = _judged(plan, *done[:4])
        processor -= done[4]
    except QuadlabError as error:
        _check_computer(error)
        reason = str(error).partition("; the log is kept: ")[0]
    except Exception as error:  # of the experiment's or a plugin's own code: it is this row's
        _check_computer(error)
        reason = f"{type(error).__name__}: {error}".splitlines()[0]
    finally:
        kept = plan.keep.logs
        if keep_log or kept == "all" or (kept == "failed" and verdict != "passed"):
            log = next((one.read_bytes() for one in folder.glob("*.mcap")), None)
        shutil.rmtree(folder, ignore_errors=True)
    outcome = Outcome(index, verdict, reason, metrics, judged=judged, log=log)
    wall, processor = time.perf_counter() - began, time.process_time() - processor
    return _here(replace(outcome, wall=wall, processor=processor))


def _alone(settings: Settings, index: int, folder: Path) -> over_logs.Figures:
    """Return verdict, reason, metrics, judged metrics, and s of processor time elsewhere."""
    from quadlab.simulated.experiment import chosen, fly

    file, plan = settings.file, settings.file.plan
    done = fly(
        chosen(file.experiment),
        seed=settings.cells.seed(index),
        words=settings.words(index // plan.seeds),
        out=folder,
        plugins=file.plugins,
        board=plan.board,
        true_state=plan.true_state,
    )
    metrics = {**done.result.metrics, "flown_s": done.flight.view().time}
    result = done.result
    reason = done.aborted or result.reason or _beyond(result.metrics, result.limits)
    return result.verdict, reason, metrics, tuple(result.limits), 0.0


def _beyond(metrics: dict[str, float], limits: dict[str, float]) -> str:
    """Return the metrics that are not within their limits, in words."""
    return "; ".join(
        f"{name} is {metrics[name]:.5g}, at most {limit:g} passes"
        for name, limit in limits.items()
        if name in metrics and not metrics[name] <= limit
    )


def _read(settings: Settings, index: int) -> over_logs.Figures:
    """Return the same of a recorded flight."""
    log, words = settings.log(index // settings.file.plan.seeds)
    return over_logs.read(settings.file.plan, log, words)


def _together(settings: Settings, index: int, folder: Path) -> over_logs.Figures:
    """Return the same of several vehicles, which one other process flies."""
    from quadlab.simulated.together import fly_together

    file, plan = settings.file, settings.file.plan
    done = fly_together(
        file.experiment,
        plan.vehicles,
        seed=settings.cells.seed(index),
        words=settings.words(index // plan.seeds),
        out=folder,
        plugins=file.plugins,
        board=plan.board,
        true_state=plan.true_state,
        processes=1,
    )
    metrics = {**done.metrics, "flown_s": done.flown}
    return done.verdict, done.reason, metrics, tuple(done.limits), done.processor


def _check_computer(error: BaseException) -> None:
    """Raise StorageError if an error was caused by a computer without disk, memory or files."""
    cause: BaseException | None = error
    while cause is not None:
        is_exhausted = isinstance(cause, OSError) and cause.errno in EXHAUSTED
        if is_exhausted or isinstance(cause, MemoryError):
            why = getattr(cause, "strerror", None) or "no memory"
            raise StorageError(
                f"a flight on {platform.node()} ended because of its computer ({why}; temporary "
                f"files are in {tempfile.gettempdir()}); the rows so far are kept: make room, then "
                "quadlab campaign resume"
            ) from error
        cause = cause.__cause__ or cause.__context__


def _judged(
    plan: Plan, verdict: str, reason: str, metrics: dict[str, float], judged: tuple[str, ...]
) -> tuple[str, str, dict[str, float], tuple[str, ...]]:
    """Apply the plan's own limits, and its choice of metrics."""
    for name, limit in plan.limits.items():
        if verdict == "passed" and (beyond := _beyond(metrics, {name: limit})):
            verdict, reason = "failed", beyond
    if plan.metrics:
        metrics = {name: value for name, value in metrics.items() if name in plan.metrics}
    judged = tuple(dict.fromkeys((*judged, *plan.limits)))
    return verdict, reason, metrics, tuple(one for one in judged if one in metrics)


def _compiled(settings: Settings, indices: Sequence[int]) -> list[Outcome]:
    from extensions.campaigns.closed_loop import JUDGED, fly_rows

    began, processor, plan = time.perf_counter(), time.process_time(), settings.file.plan
    cells: dict[int, dict[str, ParameterValue]] = {}
    for index in indices:
        cell = index // plan.seeds
        if cell not in cells:
            cells[cell] = next(settings.values(range(cell, cell + 1)))[1]
    rows = [(settings.cells.seed(index), cells[index // plan.seeds]) for index in indices]
    try:
        flown = fly_rows(settings, rows)
    except QuadlabError as error:
        if len(indices) == 1:
            return [_here(Outcome(indices[0], RAISED, str(error)))]
        return [one for index in indices for one in _compiled(settings, [index])]
    wall = (time.perf_counter() - began) / len(indices)
    processor = (time.process_time() - processor) / len(indices)
    found = []
    for index, told in zip(indices, flown, strict=True):
        verdict, reason, metrics, judged = _judged(plan, *told, JUDGED)
        outcome = Outcome(index, verdict, reason, metrics, judged=judged)
        found.append(_here(replace(outcome, wall=wall, processor=processor)))
    return found
