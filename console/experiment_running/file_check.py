"""Checks a user's experiment file in a separate process, as the file may hang or crash it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from console.experiments.client import Calibrating, Experiment
from console.experiments.user_file import load
from quadrotor.errors import JobError, JobTimeoutError, QuadlabError
from quadrotor.parameter_description import ParameterDescription
from quadrotor.parameters import ParameterStore
from vehicle_link.jobs import run

SECONDS = 30.0
"""s, enough for imports that compile; a file that takes longer counts as hanging."""


@dataclass(frozen=True)
class Described:
    """The experiment in a file, or why there is none.

    Attributes:
        name: the experiment's name; the file's name when there is a problem.
        calibration: name of the calibration it proposes; empty for none.
        problem: why it cannot run; empty when it can.
    """

    name: str
    description: str = ""
    options: tuple[ParameterDescription, ...] = ()
    calibration: str = ""
    problem: str = ""


def check(path: Path, vehicle: str, seconds: float = SECONDS) -> Described:
    """Load the file in a process and return its description."""
    try:
        return run(describe, path, vehicle, seconds=seconds)
    except JobTimeoutError as error:
        problem = f"{path.name} is {error}; move slow code into its methods"
    except JobError as error:
        problem = f"{path.name} line 1: {error}"
    return Described(path.name, problem=problem)


def describe(path: Path, vehicle: str) -> Described:
    """Describe an experiment file, inside the process."""
    try:
        experiment = load(path, vehicle)
    except QuadlabError as error:
        return Described(path.name, problem=" ".join(str(error).split()))
    return described(experiment, f"of the file {path.name}")


def described(experiment: Experiment, text: str = "") -> Described:
    """Describe an experiment; `text` is used when its class has no docstring."""
    options, name = experiment.parameters, experiment.name
    lines = ((type(experiment).__doc__ or "").strip() or text).splitlines()
    return Described(
        name,
        lines[0],
        () if options is None else ParameterStore(options).descriptions(),
        name if isinstance(experiment, Calibrating) else "",
    )
