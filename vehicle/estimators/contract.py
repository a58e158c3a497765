"""The input and answer of an estimator of one's own; see `vehicle.plugins.contract`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from quadrotor.constants import GRAVITY
from quadrotor.records import MAX_BEACONS, Record
from vehicle.plugins import host
from vehicle.plugins.contract import Array, Contract, Field, as_attributes, layout

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

INPUT = (
    Field("time", 1, "s", "since the estimator was chosen, of this IMU sample"),
    Field("dt", 1, "s", "since the last IMU sample"),
    Field("reset", 1, "", "1 when it is to begin at the start state"),
    Field("start_position_w", 3, "m", "of the built-in estimator, with `reset`; world axes, z up"),
    Field("start_velocity_w", 3, "m/s", "the same"),
    Field("start_quaternion_wb", 4, "", "the same; body to world, w x y z, unit"),
    Field("specific_force_b", 3, "m/s²", "body axes: x forward, y left, z up; +g on z at rest"),
    Field("angular_velocity_b", 3, "rad/s", "body axes, as measured"),
    Field("pose_count", 1, "", "1 when a pose came, else 0"),
    Field("pose_time", 1, "s", "when it was true: earlier than `time`"),
    Field("pose_position_w", 3, "m", ""),
    Field("pose_quaternion_wb", 4, "", "zeros: the position of a single marker"),
    Field("pose_position_deviation", 1, "m", "standard deviation on each axis"),
    Field("pose_attitude_deviation", 1, "rad", "standard deviation about each axis"),
    Field("bearing_count", 1, "", "rows of the frame of bearings that came, else 0"),
    Field("bearing_time", 1, "s", "when they were true"),
    Field("bearing_deviation", 1, "rad", "standard deviation on each of two tangent axes"),
    Field("beacon_w", 3 * MAX_BEACONS, "m", "places of the beacons, a row each", (MAX_BEACONS, 3)),
    Field("bearing_b", 3 * MAX_BEACONS, "", "unit, towards the beacon", (MAX_BEACONS, 3)),
)
OUTPUT = (
    Field("time", 1, "s", "of the input that this answers"),
    Field("position_w", 3, "m", ""),
    Field("velocity_w", 3, "m/s", ""),
    Field("quaternion_wb", 4, "", "body to world, w x y z, unit"),
    Field("gyroscope_bias_b", 3, "rad/s", "zeros when it has none"),
    Field("accelerometer_bias_b", 3, "m/s²", "zeros when it has none"),
    Field("position_variance_w", 3, "m²", "NaN when it has none; for log and charts"),
    Field("velocity_variance_w", 3, "m²/s²", "the same"),
    Field("attitude_variance_w", 3, "rad²", "the same"),
)
INPUT_TYPE, OUTPUT_TYPE = layout(INPUT), layout(OUTPUT)
ZEROS, UNKNOWN = np.zeros(3), np.full(3, math.nan)
for _constant in (ZEROS, UNKNOWN):
    _constant.flags.writeable = False


class Input(Protocol):
    """The argument of `Estimator.step`: numbers and arrays, as `INPUT` names them."""

    time: float
    dt: float
    reset: float
    start_position_w: Array
    start_velocity_w: Array
    start_quaternion_wb: Array
    specific_force_b: Array
    angular_velocity_b: Array
    pose_count: float
    pose_time: float
    pose_position_w: Array
    pose_quaternion_wb: Array
    pose_position_deviation: float
    pose_attitude_deviation: float
    bearing_count: float
    bearing_time: float
    bearing_deviation: float
    beacon_w: Array
    bearing_b: Array


class Answer(NamedTuple):
    """The result of `Estimator.step`, as `OUTPUT` names it; a plain tuple of the first three, or
    of more, will do."""

    position_w: Array
    velocity_w: Array
    quaternion_wb: Array
    gyroscope_bias_b: Array = ZEROS
    accelerometer_bias_b: Array = ZEROS
    position_variance_w: Array = UNKNOWN
    velocity_variance_w: Array = UNKNOWN
    attitude_variance_w: Array = UNKNOWN


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
ESTIMATOR = Contract("estimator", INPUT_TYPE, OUTPUT_TYPE, step, rehearsal=(_REHEARSED,))


def load(source: str | Path) -> Estimator:
    """Return an estimator; see `vehicle.plugins.host.load`."""
    estimator: Estimator = host.load(ESTIMATOR, source)
    return estimator
