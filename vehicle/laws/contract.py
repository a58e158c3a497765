"""The input and output of an external control law; see `vehicle.plugins.contract`."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np

from quadrotor.records import Record
from vehicle.plugins import host
from vehicle.plugins.contract import Array, Contract, Field, as_attributes, layout

__all__ = ["INPUT", "LAW", "OUTPUT", "Array", "Field", "Input", "Law", "hovering", "load"]

INPUT = (
    Field("time", 1, "s", "since the law was chosen"),
    Field("dt", 1, "s", "since the last tick"),
    Field("reset", 1, "", "1 when integrals are to be emptied"),
    Field("flying", 1, "", "1 between take-off and touch-down: only then may integrals grow"),
    Field("position_w", 3, "m", "world axes, z up"),
    Field("velocity_w", 3, "m/s", "world axes"),
    Field("quaternion_wb", 4, "", "body to world, w x y z, unit"),
    Field("angular_velocity_b", 3, "rad/s", "body axes: x forward, y left, z up"),
    Field("reference_position_w", 3, "m", "world axes"),
    Field("reference_velocity_w", 3, "m/s", "world axes"),
    Field("reference_acceleration_w", 3, "m/s²", "world axes"),
    Field("reference_jerk_w", 3, "m/s³", "world axes"),
    Field("reference_snap_w", 3, "m/s⁴", "world axes"),
    Field("reference_yaw", 1, "rad", "about z of the world"),
    Field("reference_yaw_rate", 1, "rad/s", ""),
    Field("reference_yaw_acceleration", 1, "rad/s²", ""),
    Field("mass", 1, "kg", "that the vehicle believes"),
    Field("inertia_b", 3, "kg m²", "diagonal, body axes"),
)
OUTPUT = (
    Field("time", 1, "s", "of the input that this answers, bit for bit"),
    Field("thrust", 1, "N", "along z of the body"),
    Field("torque_b", 3, "N m", "body axes"),
)


def names_of(field: Field) -> list[str]:
    """Return the names of a field's numbers as FMUs have them, counted from 1."""
    return (
        [field.name] if field.size == 1 else [f"{field.name}[{k + 1}]" for k in range(field.size)]
    )


INPUT_TYPE, OUTPUT_TYPE = layout(INPUT), layout(OUTPUT)


class Input(Protocol):
    """The argument of `Law.step`: numbers, and arrays of 3 or 4, as `INPUT` names them."""

    time: float
    dt: float
    reset: float
    flying: float
    position_w: Array
    velocity_w: Array
    quaternion_wb: Array
    angular_velocity_b: Array
    reference_position_w: Array
    reference_velocity_w: Array
    reference_acceleration_w: Array
    reference_jerk_w: Array
    reference_snap_w: Array
    reference_yaw: float
    reference_yaw_rate: float
    reference_yaw_acceleration: float
    mass: float
    inertia_b: Array


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


LAW = Contract("law", INPUT_TYPE, OUTPUT_TYPE, step, (".py", host.FMU))


def load(source: str | Path) -> Law:
    """Return a law; see `vehicle.plugins.host.load`."""
    law: Law = host.load(LAW, source)
    return law


def hovering(mass: float = 1.308, height: float = 1.0) -> Input:
    """Return the input of a vehicle that hovers at its reference, for tests of a law; its arrays
    may be written.

    Args:
        mass: kg. height: m.
    """
    x = np.zeros(1, INPUT_TYPE)
    x["dt"], x["flying"], x["mass"] = 0.002, 1.0, mass
    x["inertia_b"] = (0.0154, 0.0154, 0.0250)
    x["quaternion_wb"] = (1.0, 0.0, 0.0, 0.0)
    x["position_w"] = x["reference_position_w"] = (0.0, 0.0, height)
    made: Input = as_attributes(x)
    return made
