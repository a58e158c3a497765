"""The input and answer of an estimator of one's own; see `vehicle.plugins.contract`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, NamedTuple, Protocol

import numpy as np

from quadrotor.constants import GRAVITY
from quadrotor.records import MAX_BEACONS, Record
from vehicle.plugins import host
from vehicle.plugins.contract import (
    Array,
    Contract,
    Field,
    Quaternion,
    Vector,
    as_attributes,
    fields_of,
    layout,
)

__all__ = [
    "ESTIMATOR",
    "INPUT",
    "OUTPUT",
    "Answer",
    "Array",
    "Estimator",
    "Input",
    "at_rest",
    "load",
]

Rows = Annotated[Array, (MAX_BEACONS, 3)]
ZEROS, UNKNOWN = np.zeros(3), np.full(3, math.nan)
for _constant in (ZEROS, UNKNOWN):
    _constant.flags.writeable = False


class Input(Protocol):
    """The argument of `Estimator.step`."""

    time: Annotated[float, "s", "since the estimator was chosen, of this IMU sample"]
    dt: Annotated[float, "s", "since the last IMU sample"]
    reset: Annotated[float, "", "1 when it is to begin at the start state"]
    start_position_w: Annotated[
        Vector, "m", "of the built-in estimator, with `reset`; world axes, z up"
    ]
    start_velocity_w: Annotated[Vector, "m/s", "the same"]
    start_quaternion_wb: Annotated[Quaternion, "", "the same; body to world, w x y z, unit"]
    specific_force_b: Annotated[
        Vector, "m/s²", "body axes: x forward, y left, z up; +g on z at rest"
    ]
    angular_velocity_b: Annotated[Vector, "rad/s", "body axes, as measured"]
    pose_count: Annotated[float, "", "1 when a pose came, else 0"]
    pose_time: Annotated[float, "s", "when it was true: earlier than `time`"]
    pose_position_w: Annotated[Vector, "m", ""]
    pose_quaternion_wb: Annotated[Quaternion, "", "zeros: the position of a single marker"]
    pose_position_deviation: Annotated[float, "m", "standard deviation on each axis"]
    pose_attitude_deviation: Annotated[float, "rad", "standard deviation about each axis"]
    bearing_count: Annotated[float, "", "rows of the frame of bearings that came, else 0"]
    bearing_time: Annotated[float, "s", "when they were true"]
    bearing_deviation: Annotated[float, "rad", "standard deviation on each of two tangent axes"]
    beacon_w: Annotated[Rows, "m", "places of the beacons, a row each"]
    bearing_b: Annotated[Rows, "", "unit, towards the beacon"]


class Answer(NamedTuple):
    """The result of `Estimator.step`; a plain tuple of the first three, or of more, will do."""

    position_w: Annotated[Vector, "m", ""]
    velocity_w: Annotated[Vector, "m/s", ""]
    quaternion_wb: Annotated[Quaternion, "", "body to world, w x y z, unit"]
    gyroscope_bias_b: Annotated[Vector, "rad/s", "zeros when it has none"] = ZEROS
    accelerometer_bias_b: Annotated[Vector, "m/s²", "zeros when it has none"] = ZEROS
    position_variance_w: Annotated[Vector, "m²", "NaN when it has none; for log and charts"] = (
        UNKNOWN
    )
    velocity_variance_w: Annotated[Vector, "m²/s²", "the same"] = UNKNOWN
    attitude_variance_w: Annotated[Vector, "rad²", "the same"] = UNKNOWN


INPUT = fields_of(Input)
OUTPUT = (Field("time", 1, "s", "of the input that this answers"), *fields_of(Answer))
INPUT_TYPE, OUTPUT_TYPE = layout(INPUT), layout(OUTPUT)


class Estimator(Protocol):
    """An estimator of a user's file."""

    def reset(self, x: Input) -> None:
        """Begin at the start state of x; `step` is called with the same input next."""
        ...

    def step(self, x: Input) -> tuple[Array, ...]:
        """Return the estimate at `x.time`, an Answer."""
        ...


def step(estimator: Estimator, x: Input, out: Record) -> None:
    """Write the estimator's answer to x into OUTPUT_TYPE (1,)."""
    if x.reset:
        estimator.reset(x)
    answer = Answer(*estimator.step(x))
    out["time"] = x.time
    for name, value in zip(Answer._fields, answer, strict=True):
        out[name] = value


def _at_rest(height: float = 1.0) -> Record:
    """Return INPUT_TYPE (1,) of `at_rest`."""
    x = np.zeros(1, INPUT_TYPE)
    x["time"] = x["dt"] = x["pose_time"] = x["bearing_time"] = 0.002
    x["reset"] = x["pose_count"] = 1.0
    x["specific_force_b"] = (0.0, 0.0, GRAVITY)
    x["start_position_w"] = x["pose_position_w"] = (0.0, 0.0, height)
    x["start_quaternion_wb"] = x["pose_quaternion_wb"] = (1.0, 0.0, 0.0, 0.0)
    x["pose_position_deviation"], x["pose_attitude_deviation"] = 0.01, math.radians(1.0)
    x["bearing_deviation"] = math.radians(1.0)
    for row, (right, ahead) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        away = np.array([right, ahead, -height])
        x["beacon_w"][0, row], x["bearing_b"][0, row] = (
            (right, ahead, 0),
            away / np.linalg.norm(away),
        )
    return x


def at_rest(height: float = 1.0) -> Input:
    """Return the first input of a vehicle at rest, level above the origin, whose pose was just
    measured, for tests of an estimator; its arrays may be written. The first four rows of beacons
    are filled; they count with `bearing_count` = 4.

    Args:
        height: m.
    """
    made: Input = as_attributes(_at_rest(height))
    return made


_REHEARSED = _at_rest()
_REHEARSED["bearing_count"] = 4.0
_DEFAULTS = {
    name: float(value[0]) for name, value in Answer._field_defaults.items()
}  # of an FMU that has no biases or variances
ESTIMATOR = Contract("estimator", INPUT, OUTPUT, step, (_REHEARSED,), _DEFAULTS)


def load(source: str | Path) -> Estimator:
    """Return an estimator; see `vehicle.plugins.host.load`."""
    estimator: Estimator = host.load(ESTIMATOR, source)
    return estimator
