"""Errors of the tracker that a vehicle can fly with: its vertical, its scale and its stamps.

The mean of g - t for the displacement is an acceleration that the tracker does not show. Its
horizontal part is the angle between the verticals of tracker and accelerometer, times g.

Positions of another scale make t·t differ from t·g. By how much beyond what is slight is summed up
from the moment on at which it was nothing (CUSUM): an error that begins in flight is sure after as
much motion as it needs, and not after a fixed time. In a hover nothing is added: there noise would.

Stamps that are late make t late: t - g is minus that time the rate of the turn, and the slope of
the one over the other is the time.
"""

from __future__ import annotations

import math

from estimation.tracker_integrity.evidence import KNOWN, LEAST_PLACE, OUTLIER, SMALLER
from quadrotor.compiled import compiled
from quadrotor.constants import GRAVITY
from quadrotor.records import Item, Record
from quadrotor.vectors import Vector, axes_of, dot, length, quaternion, subtract

PLACE_RATE = 3.0
"""Double pole, in rad/s, of the high-pass of displacements."""
FITTED = 8.0
"""Time, in s, without doubt, after which the slopes are known."""
SLOPE_TIME = 8.0
"""Time constant, in s, of the slope that gives lateness: a lap of the 8."""
LEAST_RATE, LEAST_MOTION = 0.1, 0.03
"""Rates (rad/s, rms) from which on it is known, and displacements (m) that show the scale."""
SLIGHT, SURE = 0.025, 7e-4
"""Share that is slight, and the sum (m² s) beyond it with which a scale is surely wrong: 20 h of
rough flights without an error stay below it."""


@compiled
def errors(memory: Record) -> tuple[float, float, float, float]:
    """Return the angle (rad) between the verticals, the time (s) by which stamps are too late, the
    share by which positions are too large, each 0 while it is not known, and how sure that is, from
    1 on.
    """
    m, tilt, late, size = memory[0], 0.0, 0.0, 0.0
    if m.learnt > KNOWN:
        tilt = PLACE_RATE**2 * math.hypot(m.place_offset_w[0], m.place_offset_w[1]) / GRAVITY
    if m.fitted > FITTED and m.late[1] > LEAST_RATE**2:
        late = m.late[0] / m.late[1]
    if m.size[0] != 0.0:
        size = m.size[0] / m.size[1] + math.copysign(SLIGHT, m.size[0])
    return tilt, late, size, abs(m.size[0]) / SURE


@compiled(inner=True)
def fit(m: Item, since: float, late_b: Vector, rate_b: Vector, t_w: Vector, felt_w: Vector) -> None:
    """Add one pose to the slopes.

    A bias turns with the body, so what it adds to the displacement is constant along the heading.
    """
    x_b = axes_of(quaternion(m.quaternion_wb))[0]
    norm = math.hypot(x_b[0], x_b[1])
    c, s = (x_b[0] / norm, x_b[1] / norm) if norm > 0.1 else (1.0, 0.0)
    o, off_w = m.size_offset_h, subtract(felt_w, t_w)
    share = min(1.0, since / min(m.learnt, SLOPE_TIME))
    o[0] += share * (c * off_w[0] + s * off_w[1] - o[0])
    o[1] += share * (c * off_w[1] - s * off_w[0] - o[1])
    o[2] += share * (off_w[2] - o[2])
    g_w = subtract(felt_w, (c * o[0] - s * o[1], s * o[0] + c * o[1], o[2]))
    if length(subtract(g_w, t_w)) > SMALLER * length(g_w) + OUTLIER * LEAST_PLACE:
        return
    m.fitted += since
    share = min(1.0, since / SLOPE_TIME)
    m.late[0] += share * (dot(late_b, rate_b) - m.late[0])
    m.late[1] += share * (dot(rate_b, rate_b) - m.late[1])
    if m.fitted > FITTED and length(t_w) > LEAST_MOTION:
        moved = since * dot(t_w, g_w)
        left = min(1.0, 2.0 * SURE / abs(m.size[0])) if m.size[0] != 0.0 else 0.0
        found = left * m.size[0] + since * dot(t_w, t_w) - moved
        m.size[0] = math.copysign(max(0.0, abs(found) - SLIGHT * moved), found)
        m.size[1] = left * m.size[1] + moved
