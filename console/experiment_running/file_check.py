"""Looking at a person's own experiment in a process of its own, which may hang or die with it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from console.experiments.client import Calibrating
from console.experiments.user_file import load
from quadrotor.errors import JobError, JobTimeoutError, QuadlabError
from quadrotor.parameters import ParameterDescription, ParameterStore
from vehicle_link.jobs import run

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
    try:
        return run(describe, path, vehicle, seconds=seconds)
    except JobTimeoutError as error:
        problem = f"{path.name} is {error}; what takes long belongs into its methods"
    except JobError as error:
        problem = f"{path.name} line 1: {error}"
    return Described(path.name, problem=problem)


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
