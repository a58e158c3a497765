"""Evaluates a flight from its end to its verdict, with progress in the published status."""

from __future__ import annotations

import threading
import time

from console.experiment_running import state as phases
from console.experiment_running.evaluation import EvaluationJob, judge
from console.experiment_running.run_files import RunFiles
from console.experiment_running.status_publisher import ExperimentStatusPublisher
from console.experiments.client import FAILED, Experiment
from quadrotor.errors import QuadlabError

EVALUATION = 60.0
"""s for the evaluation, in addition to the duration of the flight."""


def judge_run(
    experiment: Experiment,
    board: ExperimentStatusPublisher,
    files: RunFiles,
    cancelled: threading.Event,
) -> None:
    """Wait for the file of the run that has ended, then for the evaluation process."""
    run_id, started = board.state.run_id, board.state.started
    board.set(phase=phases.EVALUATING, step="waiting for the run's file")
    try:
        path = files.closed(run_id)
        board.set(step="judging the run")
        seconds = EVALUATION + time.monotonic() - started
        done = judge(EvaluationJob(experiment, path, seconds), cancelled)
    except QuadlabError as error:
        phase = phases.STOPPED if cancelled.is_set() else FAILED
        kept = f"; run {run_id} is kept" if run_id else ""
        board.end(phase, f"not judged: {error}{kept}")
        return
    result = done.result
    with board.lock:
        state = board.state
        state.verdict, state.reports, state.proposal = result.verdict, done.files, done.proposal
        state.metrics, state.limits = result.metrics, result.limits
    board.end(result.verdict, "; ".join(filter(None, (result.reason, done.problem))))
