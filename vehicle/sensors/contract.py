"""The input and answer of a sensor of one's own; see `vehicle.plugins.contract`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, NamedTuple, Protocol

import numpy as np

from quadrotor.records import Record
from quadrotor.rotations import quaternion_exp, quaternion_multiply
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

__all__ = ["INPUT", "OUTPUT", "SENSOR", "Array", "Input", "Reading", "Sensor", "at_rest", "load"]

MOST = 8
"""Readings of one step."""
SMALL = 1e-4
"""m and rad, by which the pose is moved to differentiate what is expected."""


class Input(Protocol):
    """The argument of `Sensor.step`: numbers, and arrays of 3 or 4."""

    time: Annotated[float, "s", "since the sensor was chosen, of this IMU sample"]
    dt: Annotated[float, "s", "since the last one"]
    reset: Annotated[float, "", "1 when it begins"]
    flying: Annotated[float, "", "1 between arming and landing"]
    position_w: Annotated[Vector, "m", "estimate; world axes, z up"]
    velocity_w: Annotated[Vector, "m/s", "estimate; world axes"]
    quaternion_wb: Annotated[Quaternion, "", "estimate; body to world, w x y z, unit"]
    angular_velocity_b: Annotated[Vector, "rad/s", "estimate; body axes: x forward, y left, z up"]
    specific_force_b: Annotated[Vector, "m/s²", "accelerometer; +g on z at rest"]
    pressure: Annotated[float, "Pa", "of the board's barometer; NaN without one"]


Expected = Callable[[Array, Array], float]
"""Returns what a sensor would measure with the vehicle at a position (3,), m, and an attitude (4,),
body to world."""


class Reading(NamedTuple):
    """One number that was measured, in a unit of the sensor's own.

    Attributes:
        expected: by it the reading is compared with the estimate; a smooth function of the pose.
        deviation: standard deviation of the noise.
        time: when it was measured, s as `Input.time`; None: at the time of the input.
    """

    value: float
    expected: Expected
    deviation: float
    time: float | None = None


class Sensor(Protocol):
    """A sensor of a user's file."""

    def reset(self, x: Input) -> None:
        """Begin; `step` is called with the same input next."""
        ...

    def step(self, x: Input) -> Reading | Sequence[Reading] | None:
        """Return the measurements since the last step; None, or no reading, when there are none. It
        must not wait.
        """
        ...


INPUT = fields_of(Input)
OUTPUT = (
    Field("time", 1, "s", "of the input that this answers"),
    Field("count", 1, "", "readings"),
    Field("measured", MOST, "s", "when each was measured"),
    Field("position_w", 3 * MOST, "m", "the estimate at that time", (MOST, 3)),
    Field("quaternion_wb", 4 * MOST, "", "the same", (MOST, 4)),
    Field("value", MOST, "", "as measured"),
    Field("rest", MOST, "", "measured less expected there"),
    Field("row", 6 * MOST, "", "gradient of what is expected", (MOST, 6)),
    Field("sigma", MOST, "", "standard deviations"),
)
INPUT_TYPE, OUTPUT_TYPE = layout(INPUT), layout(OUTPUT)


def step(sensor: Sensor, x: Input, out: Record) -> None:
    """Write the sensor's answer to x into OUTPUT_TYPE (1,)."""
    if x.reset:
        sensor.reset(x)
    made = sensor.step(x)
    readings = () if made is None else (made,) if isinstance(made, Reading) else tuple(made)
    if len(readings) > MOST:
        raise ValueError(f"{len(readings)} readings in one step; {MOST} are taken")
    out["time"], out["count"] = x.time, len(readings)
    for k, reading in enumerate(readings):
        value, expected, deviation, time = Reading(*reading)
        time = x.time if time is None else time
        position_w, quaternion_wb = _pose_at(x, time)
        out["measured"][0, k] = time
        out["position_w"][0, k], out["quaternion_wb"][0, k] = position_w, quaternion_wb
        out["value"][0, k] = value
        out["rest"][0, k] = value - expected(position_w, quaternion_wb)
        out["row"][0, k] = _gradient(expected, position_w, quaternion_wb)
        out["sigma"][0, k] = deviation


def _pose_at(x: Input, time: float) -> tuple[Array, Array]:
    """Return the estimate at an earlier time, by the present motion: near enough to linearise."""
    since = x.time - time
    turn = quaternion_exp(-since * x.angular_velocity_b)
    return x.position_w - since * x.velocity_w, quaternion_multiply(x.quaternion_wb, turn)


def _gradient(expected: Expected, position_w: Array, quaternion_wb: Array) -> Array:
    """Return (6,): by position, and by a turn about the axes of the world."""
    row = np.zeros(6)
    for i in range(3):
        small = np.zeros(3)
        small[i] = SMALL
        for sign in (1.0, -1.0):
            turned = quaternion_multiply(quaternion_exp(sign * small), quaternion_wb)
            row[i] += sign * expected(position_w + sign * small, quaternion_wb)
            row[3 + i] += sign * expected(position_w, turned)
    return row / (2.0 * SMALL)


def _at_rest(height: float = 1.0) -> Record:
    """Return INPUT_TYPE (1,) of `at_rest`."""
    x = np.zeros(1, INPUT_TYPE)
    x["time"], x["dt"], x["reset"] = 0.002, 0.002, 1.0
    x["position_w"], x["quaternion_wb"] = (0.0, 0.0, height), (1.0, 0.0, 0.0, 0.0)
    x["specific_force_b"], x["pressure"] = (0.0, 0.0, 9.81), 1e5
    return x


SENSOR = Contract("sensor", INPUT, OUTPUT, step, rehearsal=(_at_rest(),))


def at_rest(height: float = 1.0) -> Input:
    """Return the first input of a sensor at rest, for tests; its arrays may be written.

    Args:
        height: m.
    """
    x: Input = as_attributes(_at_rest(height))
    return x


def load(source: str | Path) -> Sensor:
    """Return a sensor; see `vehicle.plugins.host.load`."""
    sensor: Sensor = host.load(SENSOR, source)
    return sensor
