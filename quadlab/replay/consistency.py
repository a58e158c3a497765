"""Consistency: whether an estimator's errors and innovations are as large as its covariance states.

NIS is the square of a measurement's innovation, NEES that of the estimate's error against the
truth, each normalised by the covariance that the estimator states; both are divided by the number
of their components, so that 1 is expected. The innovations of a sound filter are independent of
each other: their mean has bounds according to their number. Errors are not, as they persist: NEES
has the bounds of one instant, and is judged by the share of instants within them, of which 95 %
are expected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quadlab.replay.errors import Array, Stamps, Truth
from quadrotor.plain_rotations import rotation_vectors_between

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
