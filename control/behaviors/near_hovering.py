"""Near-hovering flight: angles and yaw rate for the microcontroller, which levels by itself.

No pose is needed. The reference follows the vehicle, so that the next behavior starts from there.
"""

from __future__ import annotations

import math
from typing import ClassVar

from control.behaviors.arguments import NearHoveringArguments
from control.behaviors.behavior import Behavior, Context, NoArguments, TickInputs
from control.behaviors.ground import rest_reference
from control.behaviors.table import BehaviorName
from control.behaviors.velocity import stick_axis
from quadrotor.parameters import Parameters
from quadrotor.records import Record


class Level(Behavior):
    """Level flight without yaw rate, at a climb rate: the base of both behaviors below.

    Attributes:
        roll, pitch: rad.
        yaw_rate: rad/s.
        climb: m/s, held by the barometer; None leaves the thrust to `thrust_share`.
        thrust_share: share of the hover thrust.
    """

    def __init__(self) -> None:
        self.roll = self.pitch = self.yaw_rate = 0.0
        self.climb: float | None = 0.0
        self.thrust_share = 1.0

    def step(self, tick: TickInputs, reference: Record) -> bool:
        rest_reference(tick.state, reference)
        reference["velocity_w"] = tick.state["velocity_w"]
        return False


class NearHovering(Level):
    """Behavior in which sticks tilt and turn the vehicle; released or stale ones level it."""

    name: ClassVar[BehaviorName] = BehaviorName.NEAR_HOVERING
    arguments: ClassVar[type[Parameters]] = NearHoveringArguments

    def __init__(self, context: Context, arguments: NearHoveringArguments) -> None:
        super().__init__()
        p = context.parameters
        self._angle = math.radians(p.joy_tilt)
        self._yaw_rate, self._climb, self._thrust = p.joy_yaw_rate, p.joy_speed_z, p.joy_thrust
        self._holds = arguments.hold_altitude
        self._timeout_ns = int(p.joy_timeout * 1e9)

    def step(self, tick: TickInputs, reference: Record) -> bool:
        joy, forward, left, up, turn = tick.joy, 0.0, 0.0, 0.0, 0.0
        # A stamp in the future is as wrong as an old one.
        if joy is not None and joy[2] and abs(tick.stamp_ns - joy[0]) <= self._timeout_ns:
            forward, left, up, turn = (stick_axis(value) for value in joy[1])
        self.pitch, self.roll = self._angle * forward, -self._angle * left
        self.yaw_rate = self._yaw_rate * turn
        self.climb = self._climb * up if self._holds else None
        self.thrust_share = 1.0 + self._thrust * up
        return super().step(tick, reference)


class EmergencyLanding(Level):
    """Behavior that descends level by the barometer, until ground contact is detected."""

    name: ClassVar[BehaviorName] = BehaviorName.EMERGENCY_LANDING

    def __init__(self, context: Context, arguments: NoArguments) -> None:
        super().__init__()
        self.climb = -context.parameters.emergency_landing_speed
