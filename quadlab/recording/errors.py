"""Errors of an estimate against the truth, interpolated at the estimate's stamps; and whether they
and the innovations are as large as the estimator's covariance states.

NIS is the square of a measurement's innovation, NEES that of the estimate's error against the
truth, each normalised by the covariance that the estimator states; both are divided by the number
of their components, so that 1 is expected. The innovations of a sound filter are independent of
each other: their mean has bounds according to their number. Errors are not, as they persist: NEES
has the bounds of one instant, and is judged by the share of instants within them, of which 95 %
are expected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from quadrotor.plain_rotations import rotation_vectors_between
from quadrotor.records import Array, Record, Stamps

GAP_NS = 200_000_000
"""Longest gap of the truth, in ns, across which errors are computed."""


class Truth:
    """True states at their stamps, and between them.

    Args:
        stamps_ns: (N,), in order, N >= 2.
        states: (N,) STATE; if velocities are NaN, positions are interpolated linearly.
    """

    def __init__(self, stamps_ns: Stamps, states: Record) -> None:
        self.stamps_ns = stamps_ns
        self.position_w = states["position_w"]
        self.velocity_w = states["velocity_w"]
        self.quaternion_wb = states["quaternion_wb"]

    def covers(self, stamps_ns: Stamps) -> npt.NDArray[np.bool_]:
        """Return where there are true states on both sides, at most GAP_NS apart; shape of
        `stamps_ns`.
        """
        k = self._interval(stamps_ns)
        apart = self.stamps_ns[k + 1] - self.stamps_ns[k]
        inside: npt.NDArray[np.bool_] = (stamps_ns >= self.stamps_ns[0]) & (
            stamps_ns <= self.stamps_ns[-1]
        )
        inside &= apart <= GAP_NS
        return inside

    def at(self, stamps_ns: Stamps) -> tuple[Array, Array, Array]:
        """Return position_w (M, 3), velocity_w (M, 3), quaternion_wb (M, 4) at stamps of (M,).

        Position from the cubic through both ends with their velocities, velocity linearly, attitude
        by the shortest rotation.
        """
        k = self._interval(stamps_ns)
        step = 1e-9 * (self.stamps_ns[k + 1] - self.stamps_ns[k])[:, None]
        s = (1e-9 * (stamps_ns - self.stamps_ns[k]))[:, None] / step
        p0, p1 = self.position_w[k], self.position_w[k + 1]
        v0, v1 = self.velocity_w[k], self.velocity_w[k + 1]
        line = p0 + s * (p1 - p0)
        bend = s * (1.0 - s) * ((1.0 - s) * (step * v0 - p1 + p0) - s * (step * v1 - p1 + p0))
        position = line + np.where(np.isfinite(bend), bend, 0.0)
        return position, v0 + s * (v1 - v0), _between(self.quaternion_wb, k, s)

    def _interval(self, stamps_ns: Stamps) -> Stamps:
        after = np.searchsorted(self.stamps_ns, stamps_ns, side="right")
        return np.clip(after, 1, len(self.stamps_ns) - 1) - 1


@dataclass(frozen=True)
class Errors:
    """Magnitudes of the errors at the compared samples."""

    stamps_ns: Stamps  # (M,)
    position: Array  # (M,) m
    velocity: Array  # (M,) m/s; NaN where the true velocity is unknown
    attitude: Array  # (M,) rad

    def metrics(self) -> dict[str, float | None]:
        """Return rms and largest value of each; None where unknown or not finite."""
        out: dict[str, float | None] = {}
        for name, values, unit in (
            ("position", self.position, "m"),
            ("velocity", self.velocity, "m_s"),
            ("attitude", np.degrees(self.attitude), "deg"),
        ):
            with np.errstate(over="ignore"):
                rms = math.sqrt(float(np.mean(values**2))) if len(values) else math.nan
            sound = math.isfinite(rms)
            out[f"{name}_rms_{unit}"] = rms if sound else None
            out[f"{name}_max_{unit}"] = float(values.max()) if sound else None
        return out


def errors(truth: Truth, stamps_ns: Stamps, states: Record) -> Errors:
    """Return the errors of STATE (N,) at these stamps, where `truth` covers them."""
    covered = truth.covers(stamps_ns)
    stamps_ns, states = stamps_ns[covered], states[covered]
    position, velocity, quaternion = truth.at(stamps_ns)
    return Errors(
        stamps_ns,
        np.linalg.norm(states["position_w"] - position, axis=1),
        np.linalg.norm(states["velocity_w"] - velocity, axis=1),
        angles(states["quaternion_wb"], quaternion),
    )


def angles(one: Array, other: Array) -> Array:
    """Return the angle (rad) between unit quaternions (N, 4), accurate also for small angles."""
    sign = np.where(np.sum(one * other, axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    half_chord = 0.5 * np.linalg.norm(one - sign * other, axis=1)
    found: Array = 4.0 * np.arcsin(np.minimum(half_chord, 1.0))
    return found


def _between(quaternions: Array, k: Stamps, s: Array) -> Array:
    """Return the rotation by share s (M, 1) of the way from quaternion k to the next, (M, 4)."""
    start, end = quaternions[k], quaternions[k + 1]
    share = np.sum(start * end, axis=1, keepdims=True)
    end = np.where(share < 0.0, -end, end)
    angle = np.arccos(np.minimum(np.abs(share), 1.0))
    whole = np.sin(angle)
    near = whole < 1e-6
    whole = np.where(near, 1.0, whole)
    a = np.where(near, 1.0 - s, np.sin((1.0 - s) * angle) / whole)
    b = np.where(near, s, np.sin(s * angle) / whole)
    mixed: Array = a * start + b * end
    mixed /= np.linalg.norm(mixed, axis=1, keepdims=True)
    return mixed


BOUNDS = (0.025, 0.975)
POSE, ALL = 6, 9
"""Number of errors: position and attitude; those and velocity."""


@dataclass(frozen=True)
class Posterior:
    """An estimate right after a measurement, with the estimator's covariance of it."""

    stamp_ns: int
    position_w: Array  # (3,) m
    quaternion_wb: Array  # (4,)
    velocity_w: Array  # (3,) m/s
    covariance: Array  # (9, 9) of position, attitude (rad), velocity; true - estimated, world axes


@dataclass(frozen=True)
class Consistency:
    """A mean per component, expected 1, with its 95 % bounds; `inside` is the share within them."""

    mean: float
    low: float
    high: float
    inside: float | None = None


def of_innovations(nis: Array, freedom: Array) -> Consistency | None:
    """Return the mean NIS of N measurements: `nis` per component, `freedom` components each."""
    known = np.isfinite(nis)
    total = int(freedom[known].sum())
    if total == 0:
        return None
    low, high = _bounds(total)
    return Consistency(float((nis * freedom)[known].sum()) / total, low, high)


def of_errors(truth: Truth, posteriors: list[Posterior]) -> Consistency | None:
    """Return the NEES of estimates that the truth covers; without true velocities, of the pose."""
    stamps: Stamps = np.array([one.stamp_ns for one in posteriors], np.int64)
    covered = truth.covers(stamps) if len(stamps) else np.zeros(0, bool)
    chosen = [one for one, known in zip(posteriors, covered, strict=True) if known]
    if not chosen:
        return None
    position, velocity, quaternion = truth.at(stamps[covered])
    count = ALL if np.isfinite(velocity).all() else POSE
    error = np.zeros((len(chosen), ALL))
    error[:, :3] = position - np.array([one.position_w for one in chosen])
    error[:, 3:6] = rotation_vectors_between(
        np.array([one.quaternion_wb for one in chosen]), quaternion
    )
    error[:, 6:] = velocity - np.array([one.velocity_w for one in chosen])
    covariance = np.array([one.covariance for one in chosen])[:, :count, :count]
    error = error[:, :count]
    solved = np.linalg.solve(covariance, error[:, :, None])[:, :, 0]
    nees = (error * solved).sum(axis=1) / count
    low, high = _bounds(count)
    inside = float(((nees >= low) & (nees <= high)).mean())
    return Consistency(float(nees.mean()), low, high, inside)


def _bounds(degrees: int) -> tuple[float, float]:
    """Return the bounds of a chi-square variable divided by its degrees of freedom."""
    from scipy.stats import chi2

    low, high = chi2.ppf(BOUNDS, degrees) / degrees
    return float(low), float(high)
