"""Follow a velocity: that of the sticks, in the yaw frame of the reference, or zero to brake."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from control.behaviors.behavior import Behavior, Context, Joy, NoArguments, TickInputs
from control.behaviors.parameters import BehaviorParameters
from control.behaviors.table import BehaviorName
from control.trajectories.velocity_filter import advance, new_velocity_filter
from quadrotor.records import Record


class Brake(Behavior):
    """Behavior that slows the reference down to rest, after which the vehicle hovers."""

    name: ClassVar[BehaviorName] = BehaviorName.BRAKE

    def __init__(self, context: Context, arguments: NoArguments) -> None:
        p = context.parameters
        self._filter = new_velocity_filter(
            context.reference, p.brake_deceleration, p.yaw_acceleration_max
        )

    def step(self, tick: TickInputs, reference: Record) -> bool:
        return bool(advance(self._filter, tick.dt, reference))


class Velocity(Behavior):
    """Behavior flown by sticks.

    Released, stale or missing sticks stop the vehicle, and the flight volume's walls and keep-out
    boxes slow it down.
    """

    name: ClassVar[BehaviorName] = BehaviorName.VELOCITY

    def __init__(self, context: Context, arguments: NoArguments) -> None:
        p = context.parameters
        self._filter = new_velocity_filter(
            context.reference, p.joy_acceleration, p.yaw_acceleration_max
        )
        set_walls(self._filter, p)
        self._command = self._filter["command"][0]
        self._speeds = (p.joy_speed_xy, p.joy_speed_xy, p.joy_speed_z, p.joy_yaw_rate)
        self._timeout_ns = int(p.joy_timeout * 1e9)
        self._obeyed: Joy | None = None

    def step(self, tick: TickInputs, reference: Record) -> bool:
        joy = tick.joy
        # A stamp in the future is as wrong as an old one.
        if joy is not None and (not joy[2] or abs(tick.stamp_ns - joy[0]) > self._timeout_ns):
            joy = None
        if joy is not self._obeyed:
            self._obeyed = joy
            for i in range(4):
                self._command[i] = 0.0 if joy is None else self._speeds[i] * stick_axis(joy[1][i])
        advance(self._filter, tick.dt, reference)
        return False


def set_walls(velocity_filter: Record, p: BehaviorParameters, inset: float = 0.0) -> None:
    """Set the walls of the flight volume and the keep-out boxes, `inset` (m) before them."""
    f, kept = velocity_filter[0], p.keep_out_margin + inset
    f["low_w"], f["high_w"] = np.array(p.low_w) + inset, np.array(p.high_w) - inset
    for k, box in enumerate(p.boxes):
        f["boxes_low_w"][k] = np.array(box.low_w) - kept
        f["boxes_high_w"][k] = np.array(box.high_w) + kept


def stick_axis(value: float) -> float:
    """Return a stick axis in -1..1; a value that is not finite counts as released."""
    return max(-1.0, min(1.0, value)) if math.isfinite(value) else 0.0
