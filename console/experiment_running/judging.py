"""Evaluates a flight from its end to its verdict, with progress in the published status."""

from __future__ import annotations

import threading
import time

from console.experiment_running import state as phases
from console.experiment_running.evaluation import Job, judge
from console.experiment_running.run_files import RunFiles
from console.experiment_running.status_publisher import ExperimentBoard
from console.experiments.client import Experiment
from quadrotor.errors import QuadlabError

EVALUATION = 60.0
"""s for the evaluation, in addition to the duration of the flight."""


class Judging:
    """The judgement of runs that have ended.

    Args:
        cancelled: an event that stops the evaluation.
    """

    def __init__(self, board: ExperimentBoard, files: RunFiles, cancelled: threading.Event) -> None:
        self._board, self._files = board, files
        self._cancelled = cancelled

    def judge(self, experiment: Experiment) -> None:
        """Wait for the run's file, then for the evaluation process."""
        board = self._board
        run_id, started = board.state.run_id, board.state.started
        board.set(phase=phases.EVALUATING, step="waiting for the run's file")
        try:
            path = self._files.closed(run_id)
            board.set(step="judging the run")
            seconds = EVALUATION + time.monotonic() - started
            done = judge(Job(experiment, path, seconds), self._cancelled)
        except QuadlabError as error:
            phase = phases.STOPPED if self._cancelled.is_set() else phases.FAILED
            kept = f"; run {run_id} is kept" if run_id else ""
            board.end(phase, f"not judged: {error}{kept}")
            return
        with board.lock:
            state = board.state
            state.verdict, state.reports, state.proposal = (
                done.result.verdict,
                done.files,
                done.proposal,
            )
            state.metrics, state.limits = done.result.metrics, done.result.limits
        reason = "; ".join(filter(None, (done.result.reason, done.problem)))
        board.end(done.result.verdict, reason)
