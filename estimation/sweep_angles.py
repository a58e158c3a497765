"""The sweep of a tilted plane of light: the rotor's angle when it meets a sensor.

In the rotor's frame, whose z is its axis, a plane tilted by t meets a point (x, y, z) at

    alpha = atan2(y, x) + asin(z tan t / r) - phase + m sin(atan2(y, x) + g) - c atan2(z, x)^2,

r^2 = x^2 + y^2, with m and g the magnitude and phase of its "gibbous" error and c the curvature of
its plane. The first two terms and their derivatives are derived in the documentation of
github.com/bitcraze/crazyflie-firmware ("Lighthouse kalman measurement model"); the firmware's
calibration of both types of base stations has this form. Lighthouse 1: no tilt but minus that of
the calibration. Lighthouse 2: tilts of -30 and 30 deg minus that of the calibration, m cos instead
of m sin, no curvature; its "ogee" terms are not used.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from quadrotor.compiled import compiled
from quadrotor.records import Array, Record
from quadrotor.vectors import Vector, axes_of, quaternion, subtract, to_body, to_world, vector

NARROW = 0.999
"""Largest sine of the turn that the tilt causes: near the rotor's axis there is no angle."""
Swept = tuple[float, Vector]
"""Angle (rad) and its gradient with respect to the sensor's position in the world (rad/m)."""


@compiled(inner=True)
def swept(plane: Array, sensor_w: Vector) -> Swept:
    """Return the angle at which a plane meets a sensor, with its gradient; NaN where it never does.

    Args:
        plane: (12,), the numbers of a SWEEP_PLANE in their order.
        sensor_w: m.
    """
    axes = axes_of(quaternion(plane[3:]))
    x, y, z = to_body(axes, subtract(sensor_w, vector(plane)))
    squared, across = x * x + y * y, x * x + z * z
    tangent, magnitude, curve = math.tan(plane[7]), plane[9], plane[11]
    if not (squared > 0.0 and across > 0.0 and abs(z * tangent) < NARROW * math.sqrt(squared)):
        return math.nan, (0.0, 0.0, 0.0)
    around, up = math.atan2(y, x), math.atan2(z, x)
    angle = around + math.asin(z * tangent / math.sqrt(squared)) - plane[8]
    angle += magnitude * math.sin(around + plane[10]) - curve * up * up
    slope = tangent / math.sqrt(squared - (z * tangent) ** 2)
    turn = (1.0 + magnitude * math.cos(around + plane[10])) / squared
    bend = 2.0 * curve * up / across
    gradient_r = (
        -y * turn - x * z * slope / squared + z * bend,
        x * turn - y * z * slope / squared,
        slope - x * bend,
    )
    return angle, to_world(axes, gradient_r)


def plane_numbers(sweeps: Record) -> Any:
    """Return the (12,) numbers of the plane of a SWEEPS_SAMPLE item."""
    return np.array(sweeps["plane"]).reshape(1).view(np.float64)
