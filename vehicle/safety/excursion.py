"""The excursion of a vehicle: its tilt, speed and innovation, and its distance from the walls."""

from __future__ import annotations

import math

from quadrotor.compiled import compiled
from quadrotor.records import Record
from quadrotor.vehicle_model import Four

Walls = tuple[float, float, float, float, float]
"""Least and largest x, least and largest y, largest z of the flight volume, m."""


@compiled
def excursion(state: Record, estimate: Record, walls: Walls) -> Four:
    """Return tilt (rad), speed (m/s), size of the newest innovation (m), and how far it is outside
    the walls (m, negative inside), from STATE and ESTIMATE (1,).
    """
    _, x, y, _ = state[0].quaternion_wb
    level = 1.0 - 2.0 * (x * x + y * y)
    level = max(-1.0, level) if level < 1.0 else 1.0  # a NaN, which the innovation shows, is level
    x_min, x_max, y_min, y_max, z_max = walls
    u, v, w = state[0].velocity_w
    a, b, c = estimate[0].position_innovation_w
    p = state[0].position_w
    outside = max(x_min - p[0], p[0] - x_max, y_min - p[1], p[1] - y_max, p[2] - z_max)
    speed, far = math.sqrt(u * u + v * v + w * w), math.sqrt(a * a + b * b + c * c)
    return math.acos(level), speed, far, outside
