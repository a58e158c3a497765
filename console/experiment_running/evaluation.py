"""Evaluates a run in a separate process, so that the station's threads never wait for plots."""

from __future__ import annotations

import json
import math
import subprocess
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from console.evaluation.result import FAILED, Result
from console.evaluation.verdict import evaluated
from console.experiment_running import state as phases
from console.experiment_running.run_files import RunFiles
from console.experiment_running.status_publisher import ExperimentStatusPublisher
from console.experiments.client import Calibrating, Experiment, Reporting
from console.experiments.user_file import errors_with_line
from console.reports.writer import has_report_writer
from console.runs.report_folders import report_folder, write_result
from quadrotor.calibration_record import CalibrationRecord, parse_record
from quadrotor.checkout import PREFIX, RUN_MODULE
from quadrotor.errors import JobError, QuadlabError, RefusedError, os_errors
from vehicle_link.jobs import run

EVALUATION = 60.0
"""s for the evaluation, in addition to the duration of the flight."""


@dataclass(frozen=True)
class EvaluationJob:
    """The input of an evaluation: the flown experiment, its log, and the time limit (s)."""

    experiment: Experiment
    log: Path
    seconds: float


@dataclass(frozen=True)
class Evaluation:
    """The result of an evaluation, with the report's files or why there are none."""

    result: Result
    files: tuple[str, ...]
    problem: str = ""
    proposal: str = ""
    """JSON of the proposed calibration record."""


def judge(job: EvaluationJob, cancelled: threading.Event) -> Evaluation:
    """Run the process and wait for it. Raises QuadlabError with the reason of a failure."""

    def check() -> None:
        if cancelled.is_set():
            raise RefusedError("the evaluation was stopped")

    try:
        answer = run(evaluate_and_report, job, seconds=job.seconds, check=check)
    except JobError as error:
        raise JobError(f"the evaluation of {job.experiment.name} failed: {error}") from error
    result = Result(answer["verdict"], answer["metrics"], answer["limits"], answer["reason"])
    proposal = answer["proposal"]
    return Evaluation(
        result,
        tuple(answer["files"]),
        answer["problem"],
        "" if proposal is None else CalibrationRecord(**proposal).model_dump_json(),
    )


def evaluate(job: EvaluationJob) -> dict[str, Any]:
    """Write result.json and the report's files, inside the process, and return their content.
    Raises QuadlabError.
    """
    experiment, folder = job.experiment, report_folder(job.log)
    with errors_with_line(experiment):
        result = evaluated(experiment, job.log)
    proposal, problem = proposed(job)
    with os_errors(lambda why: f"the report cannot be written: {why}"):
        folder.mkdir(exist_ok=True)
        files = []
        if isinstance(experiment, Reporting):
            try:
                with errors_with_line(experiment):
                    files = [path.name for path in experiment.report(job.log, folder)]
            except Exception as error:  # the verdict is valid without plots
                problem = "; ".join(filter(None, (problem, f"no plots: {error}")))
        content = {
            "experiment": experiment.name,
            "run_id": job.log.stem,
            "options": dict(experiment.parameters or ()),
            "verdict": result.verdict,
            "reason": result.reason,
            "metrics": {k: v for k, v in result.metrics.items() if math.isfinite(v)},
            "limits": result.limits,
            "files": files,
            "problem": problem,
            "proposal": proposal and json.loads(proposal.model_dump_json()),
        }
        write_result(job.log, content)
    return content


def proposed(job: EvaluationJob) -> tuple[CalibrationRecord | None, str]:
    """Return the proposed calibration, or None and the reason."""
    experiment = job.experiment
    if not isinstance(experiment, Calibrating):
        return None, ""
    try:
        with errors_with_line(experiment):
            return parse_record(experiment.proposal(job.log).model_dump_json()), ""
    except QuadlabError as error:
        return None, f"nothing is proposed: {error}"
    except Exception as error:  # the verdict is valid without it
        return None, f"nothing is proposed because of a software error: {error!r}"


def begin_report(log: Path) -> None:
    """Start to write the report of the whole run next to the result, in the background."""
    if not has_report_writer():
        return
    with suppress(OSError):  # the verdict is valid without it
        subprocess.Popen(
            [*RUN_MODULE, f"{PREFIX}console.reports", "--no-pdf", str(log)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )


def evaluate_and_report(job: EvaluationJob) -> dict[str, Any]:
    """Evaluate the run, and start its report in the background."""
    answer = evaluate(job)
    begin_report(job.log)
    return answer


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
