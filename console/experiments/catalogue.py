"""The built-in experiments by name."""

from __future__ import annotations

from collections.abc import Callable

from console.experiments.accelerometer import Accelerometer
from console.experiments.bearings import BearingsExperiment
from console.experiments.client import Experiment
from console.experiments.drag import DragExperiment
from console.experiments.figure_eight import FigureEight
from console.experiments.gyroscope import Gyroscope
from console.experiments.hover import Hover
from console.experiments.inertia import InertiaExperiment
from console.experiments.mass import MassExperiment
from console.experiments.motor_bench import MotorBench
from console.experiments.own_behavior import OwnBehavior
from console.experiments.tracked_body import TrackerBody, TrackerDelay
from console.experiments.vibration import VibrationExperiment
from quadrotor.errors import UsageError

EXPERIMENTS: dict[str, Callable[[str], Experiment]] = {
    "figure_eight": FigureEight,
    "hover": Hover,
    "own_behavior": OwnBehavior,
    "bearings": BearingsExperiment,
    "gyroscope": Gyroscope,
    "accelerometer": Accelerometer,
    "motor_bench": MotorBench,
    "mass": MassExperiment,
    "inertia": InertiaExperiment,
    "drag": DragExperiment,
    "vibration": VibrationExperiment,
    "tracker_delay": TrackerDelay,
    "tracker_body": TrackerBody,
}


def find(name: str, vehicle: str = "quad1") -> Experiment:
    """Return the experiment with this name. Raises UsageError, which lists the existing ones."""
    if name not in EXPERIMENTS:
        raise UsageError(f"unknown experiment {name!r}; there are {', '.join(EXPERIMENTS)}")
    return EXPERIMENTS[name](vehicle)
