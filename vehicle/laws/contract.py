"""The input and output of an external control law; see `vehicle.plugins.contract`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Protocol

import numpy as np

from quadrotor.records import Record
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

__all__ = ["INPUT", "LAW", "OUTPUT", "Array", "Field", "Input", "Law", "hovering", "load"]

OUTPUT = (
    Field("time", 1, "s", "of the input that this answers, bit for bit"),
    Field("thrust", 1, "N", "along z of the body"),
    Field("torque_b", 3, "N m", "body axes"),
)


class Input(Protocol):
    """The argument of `Law.step`: numbers, and arrays of 3 or 4."""

    time: Annotated[float, "s", "since the law was chosen"]
    dt: Annotated[float, "s", "since the last tick"]
    reset: Annotated[float, "", "1 when integrals are to be emptied"]
    flying: Annotated[float, "", "1 between take-off and touch-down: only then may integrals grow"]
    position_w: Annotated[Vector, "m", "world axes, z up"]
    velocity_w: Annotated[Vector, "m/s", "world axes"]
    quaternion_wb: Annotated[Quaternion, "", "body to world, w x y z, unit"]
    angular_velocity_b: Annotated[Vector, "rad/s", "body axes: x forward, y left, z up"]
    reference_position_w: Annotated[Vector, "m", "world axes"]
    reference_velocity_w: Annotated[Vector, "m/s", "world axes"]
    reference_acceleration_w: Annotated[Vector, "m/s²", "world axes"]
    reference_jerk_w: Annotated[Vector, "m/s³", "world axes"]
    reference_snap_w: Annotated[Vector, "m/s⁴", "world axes"]
    reference_yaw: Annotated[float, "rad", "about z of the world"]
    reference_yaw_rate: Annotated[float, "rad/s", ""]
    reference_yaw_acceleration: Annotated[float, "rad/s²", ""]
    mass: Annotated[float, "kg", "that the vehicle believes"]
    inertia_b: Annotated[Vector, "kg m²", "diagonal, body axes"]


INPUT = fields_of(Input)
INPUT_TYPE, OUTPUT_TYPE = layout(INPUT), layout(OUTPUT)


class Law(Protocol):
    """A control law of a user's file."""

    def reset(self) -> None:
        """Empty the integrals: a flight begins."""
        ...

    def step(self, x: Input) -> tuple[float, Array]:
        """Return thrust (N) and torque (3,) (N m, body axes)."""
        ...


def step(law: Law, x: Input, out: Record) -> None:
    """Write the law's answer to x into OUTPUT_TYPE (1,)."""
    if x.reset:
        law.reset()
    thrust, torque_b = law.step(x)
    out["time"], out["thrust"], out["torque_b"] = x.time, thrust, torque_b


def load(source: str | Path) -> Law:
    """Return a law; see `vehicle.plugins.host.load`."""
    law: Law = host.load(LAW, source)
    return law


def _hovering(mass: float, height: float) -> Record:
    """Return INPUT_TYPE (1,) of `hovering`."""
    x = np.zeros(1, INPUT_TYPE)
    x["dt"], x["flying"], x["mass"] = 0.002, 1.0, mass
    x["inertia_b"] = (0.0154, 0.0154, 0.0250)
    x["quaternion_wb"] = (1.0, 0.0, 0.0, 0.0)
    x["position_w"] = x["reference_position_w"] = (0.0, 0.0, height)
    return x


def hovering(mass: float = 1.308, height: float = 1.0) -> Input:
    """Return the input of a vehicle that hovers at its reference, for tests of a law; its arrays
    may be written.

    Args:
        mass: kg. height: m.
    """
    made: Input = as_attributes(_hovering(mass, height))
    return made


_REHEARSED = _hovering(1.308, 1.0)
_REHEARSED["reset"] = 1.0
LAW = Contract("law", INPUT, OUTPUT, step, (_REHEARSED,))
