"""The input and answer of a behavior of one's own; see `vehicle.plugins.contract`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, NamedTuple, Protocol

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

ZEROS = np.zeros(3)
ZEROS.flags.writeable = False


class Input(Protocol):
    """The argument of `Behavior.step`: numbers, and arrays of 3 or 4."""

    time: Annotated[float, "s", "since the behavior was chosen"]
    dt: Annotated[float, "s", "since the last tick"]
    reset: Annotated[float, "", "1 when it begins, at the reference of this input"]
    position_w: Annotated[Vector, "m", "world axes, z up"]
    velocity_w: Annotated[Vector, "m/s", "world axes"]
    quaternion_wb: Annotated[Quaternion, "", "body to world, w x y z, unit"]
    angular_velocity_b: Annotated[Vector, "rad/s", "body axes: x forward, y left, z up"]
    reference_position_w: Annotated[Vector, "m", "flown in the last tick; world axes"]
    reference_velocity_w: Annotated[Vector, "m/s", "the same"]
    reference_yaw: Annotated[float, "rad", "the same; about z of the world"]
    stick: Annotated[Array, (4,), "", "forward, left, up, yaw, from -1 to 1"]
    stick_held: Annotated[float, "", "1 while the sticks are held and fresh, else 0"]


class Answer(NamedTuple):
    """The reference at `x.time`; a plain tuple of the first one, or of more, will do.

    Derivatives that are left out are zero, a yaw that is left out stays as it is. The reference is
    continued with them until the next one.
    """

    position_w: Annotated[Vector, "m", "at `time` of the input; world axes"]
    velocity_w: Annotated[Vector, "m/s", "its derivatives"] = ZEROS
    acceleration_w: Annotated[Vector, "m/s²", ""] = ZEROS
    jerk_w: Annotated[Vector, "m/s³", ""] = ZEROS
    snap_w: Annotated[Vector, "m/s⁴", ""] = ZEROS
    yaw: Annotated[float | None, "rad", "about z of the world"] = None
    yaw_rate: Annotated[float, "rad/s", ""] = 0.0
    yaw_acceleration: Annotated[float, "rad/s²", ""] = 0.0


INPUT = fields_of(Input)
OUTPUT = (
    Field("time", 1, "s", "of the input that this answers"),
    Field("ended", 1, "", "1 when it is over: the vehicle brakes and hovers"),
    *fields_of(Answer),
)
INPUT_TYPE, OUTPUT_TYPE = layout(INPUT), layout(OUTPUT)


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


BEHAVIOR = Contract("behavior", INPUT, OUTPUT, step, rehearsal=(_hovering(),))


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
