"""Thrusts within their limits by uniform scaling, end of Sec. 4."""

from __future__ import annotations

import math

from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vehicle_model import GRAVITY, Four, thrusts_of_wrench


@compiled(inner=True)
def _largest_share(rest: float, low: float, high: float) -> float:
    """Return the largest share, 0..1, of `rest` (N) within low <= 0 <= high; 0 if not finite."""
    if rest > high:
        return high / rest if rest < math.inf else 0.0
    if rest < low:
        return low / rest if rest > -math.inf else 0.0
    return 0.0 if math.isnan(rest) else 1.0


@compiled(inner=True)
def _thrust(gravity: float, scaling: float, rest: float, low: float, high: float) -> float:
    # The clamp only removes the last bit of rounding.
    return min(high, max(low, gravity + scaling * rest)) if scaling > 0.0 else gravity


@compiled(inner=True)
def allocate(wrench: Four, model: Item) -> tuple[Four, float]:
    """Return feasible thrusts (N, motors front, left, rear, right) and the scaling lambda, 0..1.

    The paper's problem in one variable has the closed form
    lambda = min(1, (f_max - f_g) / f_r where f_r > 0, (f_min - f_g) / f_r where f_r < 0)
    with f_g = M^-1 u_g and f_r = M^-1 u_res.

    Departs from print: A^-1 there is M^-1; and where gravity alone is infeasible, the problem has
    no solution, so f_g is clipped to the limits first and the rest is the remainder of u. A wrench
    that is not finite gives f_g and lambda = 0: the motors never get a NaN.

    Args:
        wrench: thrust (N) and torques (N m).
        model: one MODEL record.
    """
    low, high = model.thrust_min, model.thrust_max
    g = min(high, max(low, 0.25 * model.mass * GRAVITY))
    a, b, c, d = thrusts_of_wrench(wrench, model.arm, model.torque_ratio)
    a, b, c, d = a - g, b - g, c - g, d - g
    down, up = low - g, high - g
    s = min(_largest_share(a, down, up), _largest_share(b, down, up))
    s = min(s, _largest_share(c, down, up))
    s = min(s, _largest_share(d, down, up))
    thrusts = (
        _thrust(g, s, a, low, high),
        _thrust(g, s, b, low, high),
        _thrust(g, s, c, low, high),
        _thrust(g, s, d, low, high),
    )
    return thrusts, s
