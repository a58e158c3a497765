"""The first-order lag between a motor's reference and its speed (Sec. 5.3 of the paper).

speed' = (gain (ref + offset) - speed) / T. Fitted by the output error: the model is run over the
recorded references and its whole course compared with the recorded one. A regression from sample
to sample would take the sensor's noise for a short time constant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from quadrotor.errors import MeasurementError

Array = npt.NDArray[np.float64]

SAMPLES_MIN = 100
BOUNDS = (0.001, 0.5)
"""s."""
FROM_FORCE = (
    "found from force alone: the sensor's own filter and the air's inertia count as lag of the "
    "motor; measure the speed to be sure"
)


@dataclass(frozen=True)
class TimeConstant:
    """Attributes:
    seconds: the constant; error: its standard error.
    rms: of the fit, in the units of what was recorded.
    warning: what makes it doubtful; empty when it was found from speed.
    """

    seconds: float
    error: float
    rms: float
    warning: str


def time_constant_from_speed(period: float, reference: Array, speed: Array) -> TimeConstant:
    """Of recordings (N,) every `period` (s); the speed in any unit.

    Raises MeasurementError for a recording that is too short, not finite, without a step, or
    sampled too slowly.
    """
    return _identify(period, reference, speed, "")


def time_constant_from_force(period: float, reference: Array, force: Array) -> TimeConstant:
    """Without a speed sensor: the root of the force (N) stands for the speed.

    Raises MeasurementError as `time_constant_from_speed`.
    """
    return _identify(period, reference, np.sqrt(np.maximum(force, 0.0)), FROM_FORCE)


def _identify(period: float, reference: Array, speed: Array, warning: str) -> TimeConstant:
    _check(reference, speed)
    from scipy.optimize import least_squares

    def miss(unknowns: Array) -> Array:
        course = _course(period, reference, math.exp(unknowns[0]))
        system = np.column_stack([course, np.ones(len(course))])
        solution, *_ = np.linalg.lstsq(system, speed, rcond=None)
        left: Array = system @ solution - speed
        return left

    low, high = (math.log(bound) for bound in BOUNDS)
    guess = np.linspace(low, high, 12)[1:-1]
    start = min(guess, key=lambda one: float(np.square(miss(np.array([one]))).sum()))
    found = least_squares(miss, [start], bounds=([low], [high]), xtol=1e-12, ftol=1e-12)
    seconds = float(math.exp(found.x[0]))
    if not 1.001 * BOUNDS[0] < seconds < 0.999 * BOUNDS[1] or seconds < period:
        raise MeasurementError(
            f"time constant {seconds:.4f} s is at the edge of what {period * 1e3:.1f} ms samples "
            f"can show ({max(BOUNDS[0], period):.3f} to {BOUNDS[1]} s); check that the reference "
            "stands in the recording with its own time"
        )
    rms = float(np.sqrt(np.mean(np.square(found.fun))))
    information = float((found.jac.T @ found.jac)[0, 0])
    error = seconds * rms / math.sqrt(information) if information > 0.0 else math.inf
    return TimeConstant(seconds, error, rms, warning)


def _check(reference: Array, speed: Array) -> None:
    if len(reference) != len(speed) or len(speed) < SAMPLES_MIN:
        raise MeasurementError(
            f"{len(reference)} references and {len(speed)} speeds; needed are as many of both, "
            f"{SAMPLES_MIN} or more"
        )
    if not (np.isfinite(reference).all() and np.isfinite(speed).all()):
        raise MeasurementError("the recording has values that are not finite; repair or repeat it")
    if np.ptp(reference) < 5.0:
        raise MeasurementError(
            f"the reference moves by {np.ptp(reference):.0f} counts, needed is a step of 5 or more"
        )


def _course(period: float, reference: Array, seconds: float) -> Array:
    """The lagged reference, held between samples, started at rest: shape (N,)."""
    from scipy.signal import lfilter

    keep = math.exp(-period / seconds)
    # Sample k has felt the references before it.
    felt = np.concatenate([reference[:1], reference[:-1]])
    course, _ = lfilter([1.0 - keep], [1.0, -keep], felt, zi=[keep * reference[0]])
    out: Array = course
    return out
