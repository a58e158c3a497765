"""Judging a run in a process of its own, so that the station's threads never wait for plots.

`python -m console.experiment_running.evaluation` takes a pickled Job on its standard input (of its
own station, never from outside), evaluates and writes the report at low priority, and answers with
one line of JSON.
"""

from __future__ import annotations

import json
import math
import os
import pickle
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from console.evaluation.verdict import evaluated
from console.experiments.client import VERDICTS, Calibrating, Experiment, Reporting, Result
from console.experiments.user_file import mistakes_told
from console.runs.report_folders import report_folder, write_result
from quadrotor.calibration_record import CalibrationRecord, parse_record
from quadrotor.checkout import ROOT
from quadrotor.errors import MeasurementError, QuadlabError, StorageError

NICENESS = 15
POLL = 0.1
MODULE = "console.experiment_running.evaluation"


@dataclass(frozen=True)
class Job:
    """An experiment that was flown, as it was after its flight; its log; s it may take."""

    experiment: Experiment
    log: Path
    seconds: float


@dataclass(frozen=True)
class Judgement:
    """The judgement of a run: the result, names of the report's files, and why there are none."""

    result: Result
    files: tuple[str, ...]
    problem: str = ""
    proposal: str = ""
    """JSON of the calibration record that it proposes."""


def judge(job: Job, cancelled: threading.Event, module: str = MODULE) -> Judgement:
    """Run the process and wait for it. Raises StorageError with the reason it failed for."""
    sent: bytes | None = _pickled(job)
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]).strip(os.pathsep)
    process = subprocess.Popen(
        [sys.executable, "-m", module],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": path},
    )
    waited = 0.0
    while True:
        try:
            out, err = process.communicate(sent, timeout=POLL)
            break
        except subprocess.TimeoutExpired:
            sent, waited = None, waited + POLL
        if cancelled.is_set() or waited > job.seconds:
            process.kill()
            process.communicate()
            why = "stopped" if cancelled.is_set() else f"not done after {job.seconds:.0f} s"
            raise StorageError(f"the evaluation was {why}")
    lines = out.decode(errors="replace").strip().splitlines()
    try:
        answer = json.loads(lines[-1])
    except (IndexError, ValueError):
        said = err.decode(errors="replace").strip().splitlines()
        raise StorageError(
            f"the evaluation failed (status {process.returncode}): "
            f"{said[-1] if said else 'it said nothing'}"
        ) from None
    if "error" in answer:
        raise StorageError(str(answer["error"]))
    result = Result(answer["verdict"], answer["metrics"], answer["limits"], answer["reason"])
    proposal = answer["proposal"]
    return Judgement(
        result,
        tuple(answer["files"]),
        answer["problem"],
        "" if proposal is None else CalibrationRecord(**proposal).model_dump_json(),
    )


def evaluate(job: Job) -> dict[str, Any]:
    """Write result.json and the report's files, in the process, and return their content. Raises
    QuadlabError.
    """
    experiment, folder = job.experiment, report_folder(job.log)
    with mistakes_told(experiment):
        result = evaluated(experiment, job.log)
    if result.verdict not in VERDICTS:
        raise MeasurementError(
            f"the verdict of {experiment.name} is {result.verdict!r:.40}; allowed are "
            f"{', '.join(VERDICTS)}"
        )
    try:  # numpy's numbers of any kind are fine, words are not
        metrics = {str(name): float(value) for name, value in result.metrics.items()}
        limits = {str(name): float(value) for name, value in result.limits.items()}
    except (TypeError, ValueError, AttributeError) as error:
        raise MeasurementError(
            f"metrics and limits of {experiment.name} are numbers by name: {error}"
        ) from error
    proposal, problem = proposed(job)
    try:
        folder.mkdir(exist_ok=True)
        files = []
        if isinstance(experiment, Reporting):
            try:
                with mistakes_told(experiment):
                    files = [path.name for path in experiment.report(job.log, folder)]
            except Exception as error:  # the verdict stands without pictures
                problem = "; ".join(filter(None, (problem, f"no plots: {error}")))
        content = {
            "experiment": experiment.name,
            "run_id": job.log.stem,
            "options": dict(experiment.parameters or ()),
            "verdict": result.verdict,
            "reason": result.reason,
            "metrics": {k: v for k, v in metrics.items() if math.isfinite(v)},
            "limits": limits,
            "files": files,
            "problem": problem,
            "proposal": proposal and json.loads(proposal.model_dump_json()),
        }
        write_result(job.log, content)
    except OSError as error:
        raise StorageError(f"the report cannot be written: {error}") from error
    return content


def proposed(job: Job) -> tuple[CalibrationRecord | None, str]:
    """Return the calibration it proposes, as another process will read it, and why there is
    none.
    """
    experiment = job.experiment
    if not isinstance(experiment, Calibrating):
        return None, ""
    try:
        with mistakes_told(experiment):
            return parse_record(experiment.proposal(job.log).model_dump_json()), ""
    except QuadlabError as error:
        return None, f"nothing is proposed: {error}"
    except Exception as error:  # the verdict stands without
        return None, f"nothing is proposed, a defect: {error!r}"


def _pickled(job: Job) -> bytes:
    """Raise StorageError for an experiment that cannot be given to another process."""
    try:
        return pickle.dumps(job)
    except Exception as error:  # of a person's own file anything may come
        raise StorageError(
            f"{job.experiment.name} cannot be given to the process that judges it ({error}); it "
            "must not keep the client, files or functions made in its methods"
        ) from error


def begin_report(log: Path) -> None:
    """Begin the page of the whole run next to the result, in its own time: no one waits for it."""
    subprocess.Popen(
        [sys.executable, "-m", "console.reports", "--no-pdf", str(log)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def main() -> int:
    job = pickle.load(sys.stdin.buffer)
    os.nice(NICENESS)
    signal.alarm(math.ceil(job.seconds) + 10)  # should the station be gone
    answered = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever prints must not come between
    try:
        answer = evaluate(job)
    except QuadlabError as error:
        answer = {"error": " ".join(str(error).split())}
    print(json.dumps(answer), file=answered, flush=True)
    if "error" not in answer:
        begin_report(job.log)
    return 0


if __name__ == "__main__":
    sys.exit(main())
