"""The firmware's attitude filter: Mahony's complementary filter with gyroscope drift.

R. Mahony, T. Hamel, J.-M. Pflimlin, "Nonlinear complementary filters on the special orthogonal
group", 2008, in its explicit form with gravity as the only direction. In flight the accelerometer
measures thrust and drag, not gravity: the correction is slow then, and fast with motors off.
"""

from __future__ import annotations

import math
from typing import Any

from quadrotor.compiled import compiled
from quadrotor.vectors import (
    Vector,
    along,
    axes_of,
    cross,
    length,
    normalized,
    quaternion,
    scale,
    store,
    subtract,
    to_body,
    turned,
    vector,
)
from quadrotor.vehicle_model import GRAVITY

Item = Any
"""One record `array[k]` inside compiled code."""

GAIN_FLYING, GAIN_RESTING = 0.1, 4.0
"""rad/s: gain towards the accelerometer's direction, with motors off."""
GAIN_TURNED, TURNED = 0.01, 0.1
"""rad/s instead, in flight, when the two differ by more than this sine: a moving vehicle is
tilted, and its accelerometer does not measure that."""
DRIFT_GAIN = 0.005
"""rad/s^2 per rad: gain of the drift in flight."""
FORCE_MARGIN = 0.3
"""Share of g by which the specific force may differ from g and still count as a direction."""
STILL = math.radians(40.0)
"""rad/s: with motors off a slower turn counts as drift, which a cold gyroscope has. What is learnt
while the vehicle is carried around decays within seconds once it is at rest."""
DRIFT_TIME = 0.5
"""s over which the drift is averaged at rest."""


@compiled(inner=True)
def estimate_attitude(p: Item, omega_b: Vector, force_b: Vector, dt: float) -> None:
    """Estimate for one period of a PROGRAM: raw angular velocity (rad/s), specific force
    (m/s^2).
    """
    bias = vector(p.gyroscope_bias)
    if not p.turning:
        rest = subtract(omega_b, bias)
        if length(rest) < STILL:
            bias = along(bias, min(1.0, dt / DRIFT_TIME), rest)
    rate = subtract(omega_b, bias)
    store(rate, p.angular_velocity_b)
    store(force_b, p.specific_force_b)
    correction = (0.0, 0.0, 0.0)
    size = length(force_b)
    if abs(size - GRAVITY) < FORCE_MARGIN * GRAVITY:
        up_b = to_body(axes_of(quaternion(p.quaternion_wb)), (0.0, 0.0, 1.0))
        correction = cross(scale(1.0 / size, force_b), up_b)
    gain = GAIN_RESTING
    if p.turning:
        gain = GAIN_FLYING if length(correction) < TURNED else GAIN_TURNED
        bias = along(bias, -DRIFT_GAIN / GAIN_FLYING * gain * dt, correction)
    store(bias, p.gyroscope_bias)
    phi = scale(dt, along(rate, gain, correction))
    q = normalized(turned(quaternion(p.quaternion_wb), phi))
    p.quaternion_wb[0], p.quaternion_wb[1], p.quaternion_wb[2], p.quaternion_wb[3] = q


@compiled(inner=True)
def angles(p: Item) -> tuple[float, float, float]:
    """Return roll, pitch (rad) and the cosine of the tilt."""
    x_b, y_b, z_b = axes_of(quaternion(p.quaternion_wb))
    return math.atan2(y_b[2], z_b[2]), -math.asin(min(1.0, max(-1.0, x_b[2]))), z_b[2]
