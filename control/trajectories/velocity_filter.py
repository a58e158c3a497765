"""A reference that follows a velocity command: sticks, braking and descending.

It is not a function of time but of the last reference: it starts from any motion without a jump in
position to jerk. The commanded velocity is slewed at the acceleration limit and passed through a
triple pole, whose impulse response is positive: the acceleration exceeds no limit.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from control.keep_out import MOST
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
        ("boxes_low_w", "f8", (MOST, 3)),  # m, keep-out boxes with their margin; the first with
        ("boxes_high_w", "f8", (MOST, 3)),  # inf below -inf is none, as are those behind it
        ("wanted", "f8", 4),  # scratch: the command in world axes, within the walls
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
    out["boxes_low_w"], out["boxes_high_w"] = np.inf, -np.inf
    return out


@compiled
def reach(reference: Record, i: int, side: float) -> float:
    """Return the coordinate along axis i that the motion reaches towards `side` (1 or -1).

    It is the farthest of the four places p, p + v/w, p + 2 v/w + a/w^2 and
    q = p + 3 v/w + 3 a/w^2 + j/w^3 (w is BANDWIDTH): the slewed velocity is the derivative of q,
    and each of the other three follows the next one as a first-order lag, so none overtakes it.
    """
    r = reference[0]
    w = BANDWIDTH
    p, v, a = r.position_w[i], r.velocity_w[i] / w, r.acceleration_w[i] / (w * w)
    q = p + 3.0 * v + 3.0 * a + r.jerk_w[i] / (w * w * w)
    if side > 0.0:
        return float(max(p, p + v, p + 2.0 * v + a, q))
    return float(min(p, p + v, p + 2.0 * v + a, q))


@compiled
def fastest(gap: float, acceleration_max: float) -> float:
    """Return the highest speed, in m/s, towards a wall or face at this distance (m)."""
    most, slowing = WALL_RATE * gap, 0.9 * acceleration_max
    if most * WALL_RATE > slowing:  # from afar, as fast as it can still slow down
        most = math.sqrt(2.0 * slowing * gap - (slowing / WALL_RATE) ** 2)
    return most


@compiled
def keep_out(velocity_filter: Record, reference: Record) -> None:
    """Limit the wanted velocity towards each box along the one axis that keeps it out best.

    One axis is enough: while the speed towards a face is at most WALL_RATE times the distance to
    it, the reference stays before that face, wherever it goes along the others. So a box asks for
    nothing while the wanted velocity leaves such an axis, and the reference passes beside it. Else
    the axis is chosen whose face the present motion respects best.

    The distance is that of `reach`.
    """
    f = velocity_filter[0]
    for k in range(MOST):
        if f.boxes_low_w[k, 0] > f.boxes_high_w[k, 0]:
            return
        is_free, best, best_room, towards, limit = False, 0, -math.inf, 1.0, 0.0
        for i in range(3):
            below = f.boxes_low_w[k, i] - reach(reference, i, 1.0)
            above = reach(reference, i, -1.0) - f.boxes_high_w[k, i]
            side = 1.0 if below > above else -1.0  # towards the box
            most = fastest(max(below, above), f.acceleration_max[i])
            room = most - max(0.0, side * f.slewed[i])
            is_free = is_free or (room >= 0.0 and most >= side * f.wanted[i])
            if room > best_room:
                best, best_room, towards, limit = i, room, side, most
        if not is_free:
            f.wanted[best] = towards * min(towards * f.wanted[best], limit)


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
            most = f.acceleration_max[i]
            wanted = min(wanted, fastest(f.high_w[i] - reach(reference, i, 1.0), most))
            wanted = max(wanted, -fastest(reach(reference, i, -1.0) - f.low_w[i], most))
        f.wanted[i] = wanted
    keep_out(velocity_filter, reference)
    for i in range(4):
        slew = f.acceleration_max[i] * h
        f.slewed[i] += min(slew, max(-slew, f.wanted[i] - f.slewed[i]))
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
