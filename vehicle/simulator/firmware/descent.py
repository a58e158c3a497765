"""The emergency descent: level, at a rate held by the barometer, motors off on the ground.

It needs nothing from outside. The horizontal drift is not controlled: only the attitude is.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.vehicle_model import GRAVITY, thrust_of_reference
from vehicle.simulator.firmware.attitude import angles
from vehicle.simulator.firmware.hovering import hold_angles
from vehicle_link.serial.attitude_command import HOVER_THRUST, THRUST_MAX
from vehicle_link.serial.ids import Id

Item = Any
"""One record `array[k]` inside compiled code."""
Registers = npt.NDArray[np.int16]

SINK, FLARE_SINK = 0.7, 0.35
"""m/s, down."""
FLARE_HEIGHT = 0.7
"""m above the take-off point: below it FLARE_SINK."""
SLOWING = 2.0
"""m/s^2: from the initial climb rate to the wanted one."""
CLIMB_GAIN, LIFT_GAIN = 3.0, 3.0
"""1/s and 1/s^2."""
THRUST_TIME = 0.5
"""s over which the commanded thrust is averaged."""
SUPPORT_TIME = 1.0
"""s over which the specific force per newton of thrust is learnt in the air."""
CARRIED_SHARE = 1.15
"""Specific force over that: the ground carries the rest."""
CARRIED_TIME = 0.3
"""s."""
STANDING_THRUST = 0.6
"""Share of the weight below which the average thrust means that the vehicle is on the ground."""
OVERTURNED = math.cos(math.radians(100.0))
TILT_MIN = 0.5
"""Least cosine that thrust is divided by."""

_EMERGENCY_THRUST = int(Id.EMERGENCY_THRUST)


@compiled(inner=True)
def watch_thrust(p: Item, dt: float) -> None:
    """Average the commanded thrust, and the specific force it gives in the air."""
    m = p.model
    total = 0.0
    for i in range(4):
        reference = float(p.references[i])
        if reference > 0.0:
            total += thrust_of_reference(reference, m.motor_slope, m.motor_offset)
    p.thrust += min(1.0, dt / THRUST_TIME) * (total - p.thrust)
    if p.thrust > STANDING_THRUST * m.mass * GRAVITY and not (p.landing and p.climb > -0.2):
        given = m.mass * p.specific_force_b[2] / p.thrust
        p.support += min(1.0, dt / SUPPORT_TIME) * (given - p.support)


@compiled(inner=True)
def descend(p: Item, registers: Registers, dt: float) -> None:
    """Run one period of the descent of a PROGRAM; sets `landed` at its end."""
    m = p.model
    weight = m.mass * GRAVITY
    _, _, cosine = angles(p)
    wanted = FLARE_SINK if p.height - p.ground < FLARE_HEIGHT else SINK
    change = SLOWING * dt
    p.sink += min(change, max(-change, wanted - p.sink))
    error = -p.sink - p.climb
    p.lift += LIFT_GAIN * m.mass * error * dt
    least = weight * registers[_EMERGENCY_THRUST] / HOVER_THRUST
    most = weight * THRUST_MAX / HOVER_THRUST
    p.lift = min(most, max(least, p.lift))
    thrust = p.lift + CLIMB_GAIN * m.mass * error
    thrust = min(most, max(least, thrust)) / max(TILT_MIN, cosine)
    hold_angles(p, registers, (0.0, 0.0, 0.0), thrust, dt)
    given = m.mass * p.specific_force_b[2] / max(p.thrust, 0.1 * weight)
    carries = given > CARRIED_SHARE * p.support and p.climb > -0.6 * p.sink
    p.carried = p.carried + dt if carries else max(0.0, p.carried - dt)
    if p.carried > CARRIED_TIME or cosine < OVERTURNED:
        stop(p)


@compiled(inner=True)
def begin_descent(p: Item) -> None:
    """Begin a descent from the present motion; a vehicle on the ground counts as landed."""
    p.landing, p.landed, p.carried = 1, 0, 0.0
    p.lift, p.sink = p.thrust, -p.climb
    p.angle_integral[0] = p.angle_integral[1] = 0.0
    if p.thrust < STANDING_THRUST * p.model.mass * GRAVITY:
        stop(p)


@compiled(inner=True)
def stop(p: Item) -> None:
    """Switch the motors off."""
    p.landed, p.landing = 1, 0
    for i in range(4):
        p.references[i] = 0
