"""Lines and circles over one ramped phase.

Position = center + slope phase + cosine cos(phase) + sine sin(phase), axis by axis, and yaw =
center + slope phase. One compiled function serves hovering, lines, circles and helices.
"""

from __future__ import annotations

import math

import numpy as np

from control.trajectories.figure_eight import circling
from control.trajectories.ramped_phase import ramped_phase
from quadrotor.compiled import compiled
from quadrotor.records import Item, Record

PHASE_CURVE = np.dtype(
    [
        ("center", "f8", 4),  # m, m, m, rad
        ("cosine", "f8", 3),  # m
        ("sine", "f8", 3),  # m
        ("slope", "f8", 4),  # m and rad, per unit of phase
        ("rate", "f8"),  # 1/s of the phase
        ("ramp", "f8"),  # s
        ("total", "f8"),  # of the phase
    ],
    align=True,
)


@compiled(inner=True)
def phase_curve_at(curve: Item, t: float, reference: Item) -> None:
    """Write the reference at t (s) on one PHASE_CURVE record into one REFERENCE record."""
    phase = ramped_phase(t, curve.rate, curve.ramp, curve.total)
    q, a, b, d, e = phase
    s = math.sin(q)
    c = math.cos(q)
    sine = circling(s, c, a, b, d, e)
    cosine = circling(c, -s, a, b, d, e)
    for i in range(3):
        j = curve.cosine[i]
        k = curve.sine[i]
        m = curve.slope[i]
        reference.position_w[i] = curve.center[i] + j * c + k * s + m * q
        reference.velocity_w[i] = j * cosine[1] + k * sine[1] + m * a
        reference.acceleration_w[i] = j * cosine[2] + k * sine[2] + m * b
        reference.jerk_w[i] = j * cosine[3] + k * sine[3] + m * d
        reference.snap_w[i] = j * cosine[4] + k * sine[4] + m * e
    m = curve.slope[3]
    reference.yaw = curve.center[3] + m * q
    reference.yaw_rate = m * a
    reference.yaw_acceleration = m * b


@compiled
def sample_phase_curve(curves: Record, t: float, references: Record, step: float = 0.0) -> None:
    """Write references[k] at t + k step (s) on curves[k], or on the last one; shapes (M,), (N,)."""
    for k in range(references.shape[0]):
        phase_curve_at(curves[min(k, curves.shape[0] - 1)], t + k * step, references[k])
