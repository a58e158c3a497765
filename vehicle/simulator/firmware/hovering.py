"""The near-hovering controller: angles, yaw rate and thrust to four motor references.

Gains are registers per unit inertia, which makes them bandwidths for any frame: a PID for roll and
pitch, and for the yaw rate a P with damping of its change.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.records import Item
from vehicle.simulator.firmware import constants as k
from vehicle.simulator.firmware.fixed import bounded, by16, root
from vehicle_link.serial.ids import Id

Registers = npt.NDArray[np.int16]

_GAIN_P, _GAIN_D, _GAIN_I = int(Id.GAIN_P), int(Id.GAIN_D), int(Id.GAIN_I)
_GAIN_YAW, _GAIN_YAW_ACCELERATION = int(Id.GAIN_YAW_RATE), int(Id.GAIN_YAW_ACCELERATION)
_TORQUE = int(Id.TORQUE_ROLL)
_ALL = 1 << 15
"""Scaling of thrusts that are within their limits."""

DEFAULT_GAINS = {
    Id.GAIN_P: 600,
    Id.GAIN_D: 120,
    Id.GAIN_I: 100,
    Id.GAIN_YAW_RATE: 120,
    Id.GAIN_YAW_ACCELERATION: 0,
}
"""Gains in counts of 0.1: 1/s^2, 1/s, 1/s^3; 1/s, 1."""


@compiled(inner=True)
def hold_angles(p: Item, registers: Registers, wanted: tuple[int, int, int], thrust: int) -> None:
    """Set the references of a PROGRAM for the given angles, yaw rate and thrust.

    Args:
        wanted: roll and pitch (2^-15 rad) and yaw rate (2^-16 count).
        thrust: 2^-12 N.
    """
    rate, integral = p.rate_b, p.angle_integral
    kp, kd, ki = registers[_GAIN_P], registers[_GAIN_D], registers[_GAIN_I]
    roll, pitch = wanted[0] - p.roll, wanted[1] - p.pitch
    x = _acceleration(roll, integral[0], rate[0], kp, ki, kd)
    y = _acceleration(pitch, integral[1], rate[1], kp, ki, kd)
    change = bounded(
        by16(rate[2] - p.rate_before, registers[_GAIN_YAW_ACCELERATION]), k.YAW_CHANGE_MAX
    )
    p.rate_before = rate[2]
    z = by16(by16((wanted[2] - rate[2]) << 4, registers[_GAIN_YAW]), k.RATE_GAIN)
    z = bounded(z - change * p.gains.yaw_slope, k.ACCELERATION_MAX)
    scaling = _allocate(
        p, thrust, by16(x, k.SHARE_ROLL), by16(y, k.SHARE_PITCH), by16(z << 2, k.SHARE_YAW)
    )
    if scaling == _ALL and abs(roll) + abs(pitch) < k.INTEGRATED:
        gain, most = p.gains.integral, k.INTEGRAL_MAX
        integral[0] = bounded(integral[0] + ((roll * gain + 0x80) >> 8), most)
        integral[1] = bounded(integral[1] + ((pitch * gain + 0x80) >> 8), most)
    registers[_TORQUE] = bounded(by16(x, k.MILLI_ROLL), 32767)
    registers[_TORQUE + 1] = bounded(by16(y, k.MILLI_PITCH), 32767)
    registers[_TORQUE + 2] = bounded(by16(z, k.MILLI_YAW), 32767)


@compiled(inner=True)
def _acceleration(error: int, integral: int, rate: int, kp: int, ki: int, kd: int) -> int:
    """Return the angular acceleration about one axis, in the unit of the gains."""
    held = by16(error << 8, kp) + (by16(integral, ki) >> 7)
    return bounded(held - by16(by16(rate << 4, kd), k.RATE_GAIN), k.ACCELERATION_MAX)


@compiled(inner=True)
def _allocate(p: Item, thrust: int, roll: int, pitch: int, yaw: int) -> int:
    """Set the references for a thrust and shares of torque (2^-12 N); return the scaling, 2^-15.

    Made feasible by uniform scaling of everything except gravity (control.allocation, end of Sec.
    4).
    """
    rest = (thrust >> 2) - k.THRUST_HOVER
    a, b = rest - pitch + yaw, rest + roll - yaw
    c, d = rest + pitch + yaw, rest - roll - yaw
    most, least = max(a, b, c, d), min(a, b, c, d)
    scaling = _ALL
    if most > k.THRUST_MAX - k.THRUST_HOVER:
        scaling = ((k.THRUST_MAX - k.THRUST_HOVER) << 15) // most
    if least < k.THRUST_MIN - k.THRUST_HOVER:
        scaling = min(scaling, ((k.THRUST_HOVER - k.THRUST_MIN) << 15) // -least)
    p.references[0] = _reference(a, scaling)
    p.references[1] = _reference(b, scaling)
    p.references[2] = _reference(c, scaling)
    p.references[3] = _reference(d, scaling)
    return scaling


@compiled(inner=True)
def _reference(rest: int, scaling: int) -> int:
    scaled = rest if scaling == _ALL else by16(rest << 1, scaling)
    thrust = min(k.THRUST_MAX, max(k.THRUST_MIN, k.THRUST_HOVER + scaled))
    reference = ((root(thrust << 16) * k.REFERENCE_SLOPE) >> 15) - k.REFERENCE_OFFSET
    return min(k.REFERENCE_MAX, (reference + 0x80) >> 8)
