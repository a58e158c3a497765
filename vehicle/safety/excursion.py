"""How far a vehicle is from rest inside its flight volume."""

from __future__ import annotations

import math

from quadrotor.compiled import compiled
from quadrotor.records import Record


@compiled
def excursion(
    state: Record,
    estimate: Record,
    x_min: float,
    x_max: float,
    y_min: float,
    y_max: float,
    z_max: float,
) -> tuple[float, float, float, float]:
    """Return tilt (rad), speed (m/s), size of the newest innovation (m), and how far it is outside
    the walls (m, negative inside), from STATE and ESTIMATE (1,).
    """
    _, x, y, _ = state[0].quaternion_wb
    level = 1.0 - 2.0 * (x * x + y * y)
    level = max(-1.0, level) if level < 1.0 else 1.0  # a NaN, which the innovation shows, is level
    u, v, w = state[0].velocity_w
    a, b, c = estimate[0].position_innovation_w
    p = state[0].position_w
    outside = max(x_min - p[0], p[0] - x_max, y_min - p[1], p[1] - y_max, p[2] - z_max)
    speed, far = math.sqrt(u * u + v * v + w * w), math.sqrt(a * a + b * b + c * c)
    return math.acos(level), speed, far, outside
