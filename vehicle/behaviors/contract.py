"""The input and answer of a behavior of one's own; see `vehicle.plugins.contract`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from quadrotor.records import Record
from vehicle.plugins import host
from vehicle.plugins.contract import Array, Contract, Field, as_attributes, layout

__all__ = [
    "BEHAVIOR",
    "INPUT",
    "OUTPUT",
    "Answer",
    "Array",
    "Behavior",
    "Input",
    "hovering",
    "load",
]

INPUT = (
    Field("time", 1, "s", "since the behavior was chosen"),
    Field("dt", 1, "s", "since the last tick"),
    Field("reset", 1, "", "1 when it begins, at the reference of this input"),
    Field("position_w", 3, "m", "world axes, z up"),
    Field("velocity_w", 3, "m/s", "world axes"),
    Field("quaternion_wb", 4, "", "body to world, w x y z, unit"),
    Field("angular_velocity_b", 3, "rad/s", "body axes: x forward, y left, z up"),
    Field("reference_position_w", 3, "m", "flown in the last tick; world axes"),
    Field("reference_velocity_w", 3, "m/s", "the same"),
    Field("reference_yaw", 1, "rad", "the same; about z of the world"),
    Field("stick", 4, "", "forward, left, up, yaw, from -1 to 1"),
    Field("stick_held", 1, "", "1 while the sticks are held and fresh, else 0"),
)
OUTPUT = (
    Field("time", 1, "s", "of the input that this answers"),
    Field("ended", 1, "", "1 when it is over: the vehicle brakes and hovers"),
    Field("position_w", 3, "m", "at `time` of the input; world axes"),
    Field("velocity_w", 3, "m/s", "its derivatives"),
    Field("acceleration_w", 3, "m/s²", ""),
    Field("jerk_w", 3, "m/s³", ""),
    Field("snap_w", 3, "m/s⁴", ""),
    Field("yaw", 1, "rad", "about z of the world"),
    Field("yaw_rate", 1, "rad/s", ""),
    Field("yaw_acceleration", 1, "rad/s²", ""),
)
INPUT_TYPE, OUTPUT_TYPE = layout(INPUT), layout(OUTPUT)
ZEROS = np.zeros(3)
ZEROS.flags.writeable = False


class Input(Protocol):
    """The argument of `Behavior.step`: numbers, and arrays of 3 or 4, as `INPUT` names them."""

    time: float
    dt: float
    reset: float
    position_w: Array
    velocity_w: Array
    quaternion_wb: Array
    angular_velocity_b: Array
    reference_position_w: Array
    reference_velocity_w: Array
    reference_yaw: float
    stick: Array
    stick_held: float


class Answer(NamedTuple):
    """The reference at `x.time`; a plain tuple of the first one, or of more, will do.

    Derivatives that are left out are zero, a yaw that is left out stays as it is. The reference is
    continued with them until the next one.
    """

    position_w: Array
    velocity_w: Array = ZEROS
    acceleration_w: Array = ZEROS
    jerk_w: Array = ZEROS
    snap_w: Array = ZEROS
    yaw: float | None = None
    yaw_rate: float = 0.0
    yaw_acceleration: float = 0.0


class Behavior(Protocol):
    """A behavior of a user's file."""

    def reset(self, x: Input) -> None:
        """Begin at the reference of x; `step` is called with the same input next."""
        ...

    def step(self, x: Input) -> tuple[Any, ...] | None:
        """Return the reference at `x.time`, an Answer; None when the behavior is over."""
        ...


def step(behavior: Behavior, x: Input, out: Record) -> None:
    """Write the behavior's answer to x into OUTPUT_TYPE (1,)."""
    if x.reset:
        behavior.reset(x)
    made = behavior.step(x)
    out["time"], out["ended"] = x.time, made is None
    if made is not None:
        answer = Answer(*made)
        for name, value in zip(Answer._fields, answer, strict=True):
            out[name] = x.reference_yaw if name == "yaw" and value is None else value


def _hovering(height: float = 1.0) -> Record:
    """Return INPUT_TYPE (1,) of `hovering`."""
    x = np.zeros(1, INPUT_TYPE)
    x["time"], x["dt"], x["reset"] = 0.002, 0.002, 1.0
    x["quaternion_wb"] = (1.0, 0.0, 0.0, 0.0)
    x["position_w"] = x["reference_position_w"] = (0.0, 0.0, height)
    return x


BEHAVIOR = Contract("behavior", INPUT_TYPE, OUTPUT_TYPE, step, rehearsal=(_hovering(),))


def hovering(height: float = 1.0) -> Input:
    """Return the first input of a behavior that begins in hover, for tests; its arrays may be
    written.

    Args:
        height: m.
    """
    x: Input = as_attributes(_hovering(height))
    return x


def load(source: str | Path) -> Behavior:
    """Return a behavior; see `vehicle.plugins.host.load`."""
    behavior: Behavior = host.load(BEHAVIOR, source)
    return behavior
