"""Extrapolation of a reference with constant snap and yaw acceleration."""

from __future__ import annotations

from quadrotor.compiled import compiled
from quadrotor.records import Record


@compiled
def extrapolate(known: Record, dt: float, reference: Record) -> None:
    """Extrapolate known[0] by dt (s) into reference[0]; both REFERENCE, shape (1,)."""
    k = known[0]
    r = reference[0]
    for i in range(3):
        v = k.velocity_w[i]
        a = k.acceleration_w[i]
        j = k.jerk_w[i]
        s = k.snap_w[i]
        r.position_w[i] = k.position_w[i] + dt * (
            v + dt * (a / 2.0 + dt * (j / 6.0 + dt * s / 24.0))
        )
        r.velocity_w[i] = v + dt * (a + dt * (j / 2.0 + dt * s / 6.0))
        r.acceleration_w[i] = a + dt * (j + dt * s / 2.0)
        r.jerk_w[i] = j + dt * s
        r.snap_w[i] = s
    r.yaw = k.yaw + dt * (k.yaw_rate + dt * k.yaw_acceleration / 2.0)
    r.yaw_rate = k.yaw_rate + dt * k.yaw_acceleration
    r.yaw_acceleration = k.yaw_acceleration
