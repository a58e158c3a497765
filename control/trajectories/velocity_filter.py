"""A reference that follows a velocity command: sticks, braking and descending.

It is not a function of time but of the last reference: it starts from any motion without a jump in
position to jerk. The commanded velocity is slewed at the acceleration limit and passed through a
triple pole, whose impulse response is positive: the acceleration exceeds no limit.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.records import Record

Array = npt.NDArray[np.float64]

BANDWIDTH = 8.0
"""Bandwidth, in rad/s, of each of the three poles."""

WALL_RATE = 0.8
"""Factor, in 1/s: the speed towards a wall is at most this times the distance to it."""

STEP_MAX = 0.05
"""Longest step, in s: after a gap in the ticks the reference continues from where it was."""

REST = 1e-3
"""Rest, in m/s and rad/s; ten times as much for acceleration and a hundred times for jerk."""

VELOCITY_FILTER = np.dtype(
    [
        ("command", "f8", 4),  # m/s forward, left, up in the reference's yaw frame; rad/s
        ("slewed", "f8", 4),  # the same in world axes, within the acceleration limits
        ("acceleration_max", "f8", 4),  # m/s^2 and rad/s^2
        ("low_w", "f8", 3),  # m, walls; -inf and inf for none
        ("high_w", "f8", 3),  # m
    ],
    align=True,
)


def new_velocity_filter(reference: Record, acceleration: float, yaw_acceleration: float) -> Record:
    """Return a filter (1,) at rest relative to reference[0], commanded to stop, without walls."""
    out = np.zeros(1, VELOCITY_FILTER)
    # The filter's state if it had produced this acceleration: snap starts near zero.
    out["slewed"][0, :3] = (
        reference["velocity_w"][0] + 3.0 * reference["acceleration_w"][0] / BANDWIDTH
    )
    out["slewed"][0, 3] = (
        reference["yaw_rate"][0] + 2.0 * reference["yaw_acceleration"][0] / BANDWIDTH
    )
    out["acceleration_max"] = (acceleration, acceleration, acceleration, yaw_acceleration)
    out["low_w"], out["high_w"] = -np.inf, np.inf
    return out


@compiled
def advance(velocity_filter: Record, dt: float, reference: Record) -> bool:
    """Advance reference[0] by dt (s); both have shape (1,). Snap is constant over the step.

    Returns whether its motion is so small that holding it would be no jump.
    """
    f = velocity_filter[0]
    r = reference[0]
    h = min(dt, STEP_MAX)
    w = BANDWIDTH
    sine = math.sin(r.yaw)
    cosine = math.cos(r.yaw)
    for i in range(4):
        wanted = f.command[i]
        if i == 0:
            wanted = cosine * f.command[0] - sine * f.command[1]
        elif i == 1:
            wanted = sine * f.command[0] + cosine * f.command[1]
        if i < 3:
            wanted = min(wanted, WALL_RATE * (f.high_w[i] - r.position_w[i]))
            wanted = max(wanted, WALL_RATE * (f.low_w[i] - r.position_w[i]))
        slew = f.acceleration_max[i] * h
        f.slewed[i] += min(slew, max(-slew, wanted - f.slewed[i]))
    for i in range(3):
        v = r.velocity_w[i]
        a = r.acceleration_w[i]
        j = r.jerk_w[i]
        s = w * w * w * (f.slewed[i] - v) - 3.0 * w * w * a - 3.0 * w * j
        r.position_w[i] += h * (v + h * (a / 2.0 + h * (j / 6.0 + h * s / 24.0)))
        r.velocity_w[i] = v + h * (a + h * (j / 2.0 + h * s / 6.0))
        r.acceleration_w[i] = a + h * (j + h * s / 2.0)
        r.jerk_w[i] = j + h * s
        r.snap_w[i] = s
    a = r.yaw_acceleration
    j = w * w * (f.slewed[3] - r.yaw_rate) - 2.0 * w * a
    r.yaw += h * (r.yaw_rate + h * (a / 2.0 + h * j / 6.0))
    r.yaw_rate += h * (a + h * j / 2.0)
    r.yaw_acceleration = a + h * j
    largest = max(abs(r.yaw_rate), 0.1 * abs(r.yaw_acceleration))
    for i in range(3):
        slow = max(abs(r.velocity_w[i]), 0.1 * abs(r.acceleration_w[i]))
        largest = max(largest, slow, 0.01 * abs(r.jerk_w[i]))
    return bool(largest < REST)
