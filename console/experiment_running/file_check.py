"""Looking at a person's own experiment in a process of its own, which may hang or die with it.

`python -m console.experiment_running.file_check FILE VEHICLE` answers with one line of JSON.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from console.experiments.client import Calibrating
from console.experiments.user_file import load
from quadrotor.checkout import ROOT
from quadrotor.errors import QuadlabError
from quadrotor.parameters import ParameterDescription, ParameterStore

MODULE = "console.experiment_running.file_check"
NICENESS = 15
SECONDS = 30.0
"""for imports that compile; a file that takes longer is one that hangs."""


@dataclass(frozen=True)
class Described:
    """A file's experiment, or why it has none.

    Attributes:
        name: of the experiment; the file's own when there is a problem.
        calibration: what it proposes; empty for nothing.
        problem: why it cannot run; empty when it can.
    """

    name: str
    description: str = ""
    options: tuple[ParameterDescription, ...] = ()
    calibration: str = ""
    problem: str = ""


def check(path: Path, vehicle: str, seconds: float = SECONDS) -> Described:
    """Load it in a process and tell what it is."""
    python_path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]).strip(os.pathsep)
    try:
        ran = subprocess.run(
            [sys.executable, "-m", MODULE, str(path), vehicle],
            capture_output=True,
            timeout=seconds,
            check=False,
            stdin=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": python_path},
        )
    except subprocess.TimeoutExpired:
        return Described(
            path.name,
            problem=f"{path.name} is not loaded after {seconds:g} s; what takes long "
            "belongs into its methods",
        )
    except OSError as error:
        return Described(path.name, problem=f"{path.name} cannot be looked at: {error}")
    lines = ran.stdout.decode(errors="replace").strip().splitlines()
    try:
        fields: dict[str, Any] = json.loads(lines[-1])
    except (IndexError, ValueError):
        said = ran.stderr.decode(errors="replace").strip().splitlines()
        why = said[-1] if said else f"it ended its process (status {ran.returncode})"
        return Described(path.name, problem=f"{path.name} line 1: {why}")
    options = tuple(
        ParameterDescription(**{**one, "choices": tuple(one["choices"] or ())})
        for one in fields.pop("options")
    )
    return Described(**fields, options=options)


def describe(path: Path, vehicle: str) -> Described:
    """Describe an experiment file, in the process."""
    try:
        experiment = load(path, vehicle)
    except QuadlabError as error:
        return Described(path.name, problem=" ".join(str(error).split()))
    options = experiment.parameters
    text = (type(experiment).__doc__ or "").strip() or f"of the file {path.name}"
    return Described(
        experiment.name,
        text.splitlines()[0],
        () if options is None else ParameterStore(options).descriptions(),
        experiment.name if isinstance(experiment, Calibrating) else "",
    )


def main() -> int:
    os.nice(NICENESS)
    signal.alarm(round(SECONDS) + 10)  # should the station be gone
    answered = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever the file prints must not come between
    found = describe(Path(sys.argv[1]), sys.argv[2])
    print(json.dumps(asdict(found)), file=answered, flush=True)
    return 0


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    os._exit(code)  # threads that the file may have started do not hold it
