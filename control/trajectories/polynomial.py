"""Polynomials of ninth order: from any motion to any motion, and through way-points.

Ten coefficients an axis meet position to snap at both ends, so that pieces join C4.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.records import Record
from quadrotor.rotations import wrap_angle

Array = npt.NDArray[np.float64]

ORDER = 9


def _falling(n: int, k: int) -> float:
    """n (n - 1) ... (n - k + 1)."""
    return float(math.prod(range(n - k + 1, n + 1)))


_HIGH = np.array([[_falling(n, k) for n in range(5, 10)] for k in range(5)])
_LOW = np.array([[_falling(n, k) if n >= k else 0.0 for n in range(5)] for k in range(5)])


@compiled
def sample_polynomial(times: Array, coefficients: Array, t: float, reference: Record) -> None:
    """The reference at t (s) into reference[0].

    Args:
        times: (S + 1,) s, ends of the segments, from 0, growing.
        coefficients: (S, 4, 10) of powers of the share of each segment's time, axes x, y, z, yaw.
    """
    r = reference[0]
    k = 0
    while k < coefficients.shape[0] - 1 and t >= times[k + 1]:
        k += 1
    span = times[k + 1] - times[k]
    x = min(1.0, max(0.0, (t - times[k]) / span))
    out = np.zeros((4, 5))
    for i in range(4):
        scale = 1.0
        for d in range(5):
            total = 0.0
            for n in range(ORDER, d - 1, -1):  # Horner on the d-th derivative
                factor = 1.0
                for m in range(d):
                    factor *= n - m
                total = total * x + factor * coefficients[k, i, n]
            out[i, d] = total * scale
            scale /= span
    for i in range(3):
        r.position_w[i] = out[i, 0]
        r.velocity_w[i] = out[i, 1]
        r.acceleration_w[i] = out[i, 2]
        r.jerk_w[i] = out[i, 3]
        r.snap_w[i] = out[i, 4]
    r.yaw = out[3, 0]
    r.yaw_rate = out[3, 1]
    r.yaw_acceleration = out[3, 2]


def hermite(start: Array, end: Array, duration: float) -> Array:
    """Coefficients (4, 10) that meet `start` and `end`, each (4, 5): value to 4th derivative."""
    scale = duration ** np.arange(5.0)
    low = start * scale / np.array([1.0, 1.0, 2.0, 6.0, 24.0])
    high = np.linalg.solve(_HIGH, (end * scale).T - _LOW @ low.T).T
    return np.hstack([low, high])


def motion_of(reference: Record) -> Array:
    """(4, 5): x, y, z, yaw and their derivatives to the fourth of reference[0]."""
    out = np.zeros((4, 5))
    for k, name in enumerate(("position_w", "velocity_w", "acceleration_w", "jerk_w", "snap_w")):
        out[:3, k] = reference[name][0]
    out[3, :3] = [reference[name][0] for name in ("yaw", "yaw_rate", "yaw_acceleration")]
    return out


class Polynomial:
    """Segments of ninth order; after the last the end is held, which must be at rest.

    Args:
        times: (S + 1,) s, from 0, growing.
        coefficients: (S, 4, 10), see `hermite`.
    """

    def __init__(self, times: Array, coefficients: Array) -> None:
        self._times = np.ascontiguousarray(times, dtype=float)
        self._coefficients = np.ascontiguousarray(coefficients, dtype=float)
        self.duration = float(times[-1])

    def sample(self, t: float, reference: Record) -> None:
        sample_polynomial(self._times, self._coefficients, t, reference)


def to_rest(start: Record, end: tuple[float, float, float, float], duration: float) -> Polynomial:
    """From the reference `start`, moving or not, to rest at (x, y, z, yaw) in `duration` s.

    Turns the short way.
    """
    motion = motion_of(start)
    goal = np.zeros((4, 5))
    goal[:, 0] = end
    goal[3, 0] = motion[3, 0] + wrap_angle(end[3] - motion[3, 0])
    return Polynomial(np.array([0.0, duration]), hermite(motion, goal, duration)[None])


def through(waypoints: Array, times: Array) -> Polynomial:
    """From rest through way-points to rest.

    Velocities in between are those of a Catmull-Rom spline, higher derivatives zero there.

    Args:
        waypoints: (S + 1, 4) x, y, z (m), yaw (rad, not wrapped).
        times: (S + 1,) s, from 0, growing.

    Raises ValueError when the shapes do not fit or the times do not grow from 0.
    """
    points, at = np.asarray(waypoints, dtype=float), np.asarray(times, dtype=float)
    if points.ndim != 2 or points.shape != (len(at), 4) or len(at) < 2:
        raise ValueError(
            f"way-points of shape {points.shape} with {len(at)} times: "
            "give (S + 1, 4) points and S + 1 times, S at least 1"
        )
    if at[0] != 0.0 or not np.all(np.diff(at) > 0.0):
        raise ValueError(f"times {at.tolist()} must start at 0 and grow")
    motion = np.zeros((len(at), 4, 5))
    motion[:, :, 0] = points
    motion[1:-1, :, 1] = (points[2:] - points[:-2]) / (at[2:] - at[:-2])[:, None]
    pieces = [hermite(motion[k], motion[k + 1], at[k + 1] - at[k]) for k in range(len(at) - 1)]
    return Polynomial(at, np.stack(pieces))
