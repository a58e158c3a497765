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

from console.experiments.client import Experiment, Reporting, Result
from console.run_reports import RESULT, report_folder
from quadrotor.errors import QuadlabError, StorageError

NICENESS = 15
POLL = 0.1
ROOT = Path(__file__).parents[1]
MODULE = "console.experiment_running.evaluation"


@dataclass(frozen=True)
class Job:
    """An experiment that was flown, as it was after its flight; its log; s it may take."""

    experiment: Experiment
    log: Path
    seconds: float


@dataclass(frozen=True)
class Judgement:
    """What came of it: the result, names of the report's files, and why there are none."""

    result: Result
    files: tuple[str, ...]
    problem: str = ""


def judge(job: Job, cancelled: threading.Event, module: str = MODULE) -> Judgement:
    """Run the process and wait for it. Raises StorageError with the reason it failed for."""
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]).strip(os.pathsep)
    process = subprocess.Popen(
        [sys.executable, "-m", module],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": path},
    )  # fmt: skip
    sent: bytes | None = pickle.dumps(job)
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
    result = Result(answer["verdict"], answer["metrics"], answer["limits"])
    return Judgement(result, tuple(answer["files"]), answer["problem"])


def evaluate(job: Job) -> dict[str, Any]:
    """In the process: result.json and the report's files; what they say. Raises QuadlabError."""
    experiment, folder = job.experiment, report_folder(job.log)
    result = experiment.evaluate(job.log)
    try:
        folder.mkdir(exist_ok=True)
        files, problem = [], ""
        if isinstance(experiment, Reporting):
            try:
                files = [path.name for path in experiment.report(job.log, folder)]
            except Exception as error:  # the verdict stands without pictures
                problem = f"no plots: {error}"
        content = {
            "experiment": experiment.name,
            "run_id": job.log.stem,
            "options": dict(experiment.parameters or ()),
            "verdict": result.verdict,
            "metrics": {k: v for k, v in result.metrics.items() if math.isfinite(v)},
            "limits": result.limits,
            "files": files,
            "problem": problem,
        }
        aside = folder / f"{RESULT}.new"
        aside.write_text(json.dumps(content, indent=1))
        aside.replace(folder / RESULT)
    except OSError as error:
        raise StorageError(f"the report cannot be written: {error}") from error
    return content


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
    return 0


if __name__ == "__main__":
    sys.exit(main())
