"""The law of motor, controller and propeller from a bench's steps (Sec. 5.3 of the paper).

A rotor's speed is affine in the reference and its force quadratic in the speed, so that ref = alpha
+ beta sqrt(f). The paper's fit, ref quadratic in f, is given for comparison: it misses by counts
what the root law fits (docs/deviations.md). Steps outside the range of flight are left out, as in
the paper.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimation.calibration.motor_bench import BenchSteps
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

USABLE = (30.0, 180.0)
"""Usable range of references, in counts, as in the paper."""
STEPS_MIN = 5


@dataclass(frozen=True)
class Fit:
    """Reference as a function of force, with its errors in counts."""

    coefficients: tuple[float, ...]
    residuals: Array  # (N,) of the used steps

    @property
    def worst(self) -> float:
        return float(np.abs(self.residuals).max())

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(np.square(self.residuals))))


@dataclass(frozen=True)
class MotorCalibration:
    """The law f = (slope (ref + offset))^2 and the torque ratio.

    Attributes:
        slope: sqrt(N) per count.
        offset: counts.
        torque_ratio: m.
        root: ref = alpha + beta sqrt(f), coefficients (alpha, beta).
        quadratic: ref = a f^2 + b f + c, coefficients (a, b, c).
        torque_residual: N m, largest error of torque = torque_ratio * force.
        steps: those used.
        thrust_min, thrust_max: N at the ends of the usable range.
    """

    slope: float
    offset: float
    torque_ratio: float
    root: Fit
    quadratic: Fit
    torque_residual: float
    steps: BenchSteps
    thrust_min: float
    thrust_max: float


def identify_motor(steps: BenchSteps) -> MotorCalibration:
    """Fit the motor law to the steps. Raises MeasurementError when there are too few steps or their
    forces do not rise.
    """
    inside = (steps.reference >= USABLE[0]) & (steps.reference <= USABLE[1])
    used = BenchSteps(
        steps.reference[inside],
        steps.force[inside],
        steps.torque[inside],
        steps.force_error[inside],
        steps.samples[inside],
    )
    if len(used.reference) < STEPS_MIN:
        raise MeasurementError(
            f"{len(used.reference)} steps between {USABLE[0]:.0f} and {USABLE[1]:.0f} counts, "
            f"needed are {STEPS_MIN}; run the bench over more references"
        )
    order = np.argsort(used.reference)
    force = used.force[order]
    wrong = np.flatnonzero(np.diff(force, prepend=0.0) <= 0.0)
    if len(wrong):
        first = int(wrong[0])
        raise MeasurementError(
            f"the force at {used.reference[order][first]:.0f} counts is {force[first]:.3f} N; it "
            "must be above 0 and rise from step to step. Check the sensor's sign and zero, and "
            "that the propeller blows away from it"
        )
    root = _fit(np.column_stack([np.ones(len(used.force)), np.sqrt(used.force)]), used.reference)
    quadratic = _fit(np.vander(used.force, 3), used.reference)
    alpha, beta = root.coefficients
    slope, offset = 1.0 / beta, -alpha
    ratio = float(used.force @ used.torque / (used.force @ used.force))
    ends = [(slope * (reference + offset)) ** 2 for reference in USABLE]
    return MotorCalibration(
        slope,
        offset,
        torque_ratio=abs(ratio),
        root=root,
        quadratic=quadratic,
        torque_residual=float(np.abs(used.torque - ratio * used.force).max()),
        steps=used,
        thrust_min=ends[0],
        thrust_max=ends[1],
    )


def _fit(system: Array, reference: Array) -> Fit:
    solution, *_ = np.linalg.lstsq(system, reference, rcond=None)
    return Fit(tuple(solution.tolist()), system @ solution - reference)
