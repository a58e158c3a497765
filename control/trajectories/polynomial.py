"""Polynomials of ninth order: from any motion to any motion, and through way-points.

Ten coefficients per axis match position to snap at both ends, so that pieces join C4.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from control.trajectories.trajectory import SAMPLES_MAX, UNKNOWN_RATE, Stretch, around
from quadrotor.compiled import compiled
from quadrotor.records import Record

Array = npt.NDArray[np.float64]

ORDER = 9


def _falling(n: int, k: int) -> float:
    """Return n (n - 1) ... (n - k + 1)."""
    return float(math.prod(range(n - k + 1, n + 1)))


_HIGH = np.array([[_falling(n, k) for n in range(5, 10)] for k in range(5)])
_LOW = np.array([[_falling(n, k) if n >= k else 0.0 for n in range(5)] for k in range(5)])


@compiled
def sample_polynomial(
    times: Array, coefficients: Array, t: float, references: Record, step: float = 0.0
) -> None:
    """Write references at t + n step (s) into references[n], shape (N,).

    Args:
        times: (S + 1,) s, ends of the segments, from 0, increasing.
        coefficients: (S, 4, 10) of powers of the share of each segment's time, axes x, y, z, yaw.
    """
    last = coefficients.shape[2] - 1
    for m in range(references.shape[0]):
        r = references[m]
        at = t + m * step
        k = 0
        after = coefficients.shape[0]
        while after - k > 1:
            middle = (k + after) >> 1
            if at >= times[middle]:
                k = middle
            else:
                after = middle
        per = 1.0 / (times[k + 1] - times[k])
        x = min(1.0, max(0.0, (at - times[k]) * per))
        for i in range(coefficients.shape[1]):
            # Horner's scheme, repeated: the derivatives over their factorials.
            p = v = a = j = s = 0.0
            for n in range(last + 1):
                s = s * x + j
                j = j * x + a
                a = a * x + v
                v = v * x + p
                p = p * x + coefficients[k, i, last - n]
            v *= per
            a *= 2.0 * per * per
            if i == 3:
                r.yaw = p
                r.yaw_rate = v
                r.yaw_acceleration = a
            else:
                r.position_w[i] = p
                r.velocity_w[i] = v
                r.acceleration_w[i] = a
                r.jerk_w[i] = 6.0 * j * per * per * per
                r.snap_w[i] = 24.0 * s * (per * per) * (per * per)


def hermite(start: Array, end: Array, duration: float) -> Array:
    """Return coefficients (4, 10) from `start` and `end`, each (4, 5): value to 4th derivative."""
    scale = duration ** np.arange(5.0)
    low = start * scale / np.array([1.0, 1.0, 2.0, 6.0, 24.0])
    high = np.linalg.solve(_HIGH, (end * scale).T - _LOW @ low.T).T
    return np.hstack([low, high])


def ends_to_coefficients() -> Array:
    """Return the matrix (10, 10) from value to 4th derivative at both ends to coefficients.

    The piece has unit time.
    """
    units = np.eye(10)
    return np.array([hermite(u[None, :5], u[None, 5:], 1.0)[0] for u in units]).T


def motion_of(reference: Record) -> Array:
    """Return (4, 5): x, y, z, yaw and their derivatives to the fourth of reference[0]."""
    out = np.zeros((4, 5))
    for k, name in enumerate(("position_w", "velocity_w", "acceleration_w", "jerk_w", "snap_w")):
        out[:3, k] = reference[name][0]
    out[3, :3] = [reference[name][0] for name in ("yaw", "yaw_rate", "yaw_acceleration")]
    return out


class Polynomial:
    """Segments of ninth order; after the last, the end is held, which must be at rest.

    Args:
        times: (S + 1,) s, from 0, increasing.
        coefficients: (S, 4, 10), see `hermite`.
        extremes: times (s) known to hold extremes; a path of many segments is then checked densely
            only there, and no more than a check in flight allows.
    """

    def __init__(self, times: Array, coefficients: Array, extremes: tuple[float, ...] = ()) -> None:
        self.times = np.ascontiguousarray(times, dtype=float)
        """The times of the knots, (S + 1,) s."""
        self.coefficients = np.ascontiguousarray(coefficients, dtype=float)
        """The coefficients (S, 4, 10), see `sample_polynomial`."""
        self.extremes = extremes
        self.duration = float(times[-1])

    def slowed(self, factor: float) -> Polynomial:
        """Return the same path in `factor` times the time."""
        extremes = tuple(factor * t for t in self.extremes)
        return Polynomial(self.times * factor, self.coefficients, extremes)

    def moved(self, start: tuple[float, float, float, float]) -> Polynomial:
        """Return the same path, shifted and turned about z_W to begin at (x, y, z, yaw)."""
        first = self.coefficients[0, :, 0]
        angle = start[3] - float(first[3])
        s, c = math.sin(angle), math.cos(angle)
        out = self.coefficients.copy()
        x, y = self.coefficients[:, 0], self.coefficients[:, 1]
        out[:, 0], out[:, 1] = c * x - s * y, s * x + c * y
        out[:, :, 0] += np.array(start) - out[0, :, 0]
        return Polynomial(self.times, out, self.extremes)

    def sample(self, t: float, reference: Record) -> None:
        sample_polynomial(self.times, self.coefficients, t, reference, 0.0)

    def sample_grid(self, t: float, step: float, references: Record) -> None:
        sample_polynomial(self.times, self.coefficients, t, references, step)

    def stretches(self) -> tuple[Stretch, ...]:
        """Return each segment if there are few, else an even grid, finer at known extremes."""
        if len(self.coefficients) <= 20:
            return tuple((a, b, 48) for a, b in pairwise(self.times.tolist()))
        if not self.extremes:
            count = min(SAMPLES_MAX, max(1000, round(self.duration * UNKNOWN_RATE)))
            return ((0.0, self.duration, count),)
        return around(self.extremes, self.duration)
