"""The first-order lag between a motor's reference and its speed (Sec. 5.3 of the paper).

speed' = (gain (ref + offset) - speed) / T, identified from the output error: the model's whole
response is compared with the recorded one. A regression from sample to sample would mistake the
sensor's noise for a short time constant. The dead time of line and sensor is identified as well,
because a fit without it would count it as lag; each step has its own, as a busy line delays them
differently.

Reference and sensor have their own stamps and rates. Between two changes of the reference the speed
follows an exponential, known in closed form at any time: nothing is resampled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from quadrotor.errors import MeasurementError
from quadrotor.records import Array

BOUNDS = (0.001, 0.5)
"""Bounds of the time constant, s."""
FROM_FORCE = (
    "found from force alone: the sensor's own filter and the air's inertia count as lag of the "
    "motor; measure the speed to be sure"
)
DEAD_TIME = (-0.02, 0.1)
"""Bounds of the dead time, s; below zero when the two clocks differ."""
SAMPLES_MIN = 50
BEFORE = 0.1
"""Seconds of the recording before the first step of the reference: the motor must have settled by
then, however it was started."""
AFTER = 0.6
"""Seconds after a step that are used for the lag."""
STEP_MIN = 5.0
"""Smallest step of the reference, in counts."""
APART = 0.2
"""Smallest time in s between steps for separate dead times; their number is limited, too."""
STEPS_MAX = 100
JITTER_MAX = 0.005
"""Difference in s between the dead times of steps above which it is reported."""


@dataclass(frozen=True)
class TimeConstant:
    """The time constant of a motor.

    Attributes:
        seconds: the constant.
        error: its standard error, s.
        rms: of the fit, in the unit of the recording.
        warning: what makes it doubtful; empty when it was found from speed.
    """

    seconds: float
    error: float
    rms: float
    warning: str


def lag_and_dead_time(
    reference_time: Array, reference: Array, time: Array, signal: Array, *, is_force: bool = False
) -> tuple[TimeConstant, float]:
    """Return the time constant, and the dead time (s) that was found with it.

    Args:
        reference_time, reference: (M,) s and counts, each held until the next.
        time, signal: (N,) s, and a speed in any unit, or a force in N whose root represents it.

    Raises MeasurementError for a recording that is too short, not finite or without a step, or
    whose samples are too slow for the lag.
    """
    steps = _steps_of(reference_time, reference, time, signal)
    speed = np.sqrt(np.maximum(steps.shown, 0.0)) if is_force else steps.shown
    unknowns, left, jacobian = _fitted(steps, speed - speed.mean())
    seconds, dead_times = float(math.exp(unknowns[0])), unknowns[1:]
    period = float(np.median(np.diff(steps.at)))
    if not 1.001 * BOUNDS[0] < seconds < 0.999 * BOUNDS[1] or seconds < period:
        raise MeasurementError(
            f"time constant {seconds:.4f} s is at the edge of what {period * 1e3:.1f} ms samples "
            f"can show ({max(BOUNDS[0], period):.3f} to {BOUNDS[1]} s); check that the reference "
            "stands in the recording with its own time"
        )
    rms = float(np.sqrt(np.mean(np.square(left))))
    covariance = np.linalg.pinv(jacobian.T @ jacobian)
    error = seconds * rms * math.sqrt(float(covariance[0, 0]))
    warnings = [FROM_FORCE] if is_force else []
    early, late = np.quantile(dead_times, (0.1, 0.9))
    if late - early > JITTER_MAX:
        warnings.append(
            f"references reached the motor {1e3 * early:.0f} to {1e3 * late:.0f} ms late: the line "
            "or the computers are busy"
        )
    return TimeConstant(seconds, error, rms, "; ".join(warnings)), float(np.median(dead_times))


class _Steps(NamedTuple):
    """A recording around the steps of its reference.

    Attributes:
        at, shown: (N,) s since the first step, and the signal.
        begins, held: s since the first step, and the values before the first step and from each on.
        apart: whether the steps are far enough apart for a dead time of each.
    """

    at: Array
    shown: Array
    begins: Array
    held: Array
    apart: bool


def _steps_of(reference_time: Array, reference: Array, time: Array, signal: Array) -> _Steps:
    """Return the steps in a recording. Raises MeasurementError."""
    changes = np.flatnonzero(np.diff(reference)) + 1
    if len(changes) == 0 or np.ptp(reference) < STEP_MIN:
        most = np.ptp(reference) if len(reference) else 0.0
        raise MeasurementError(
            f"the reference moves by {most:.0f} counts, needed is a step of {STEP_MIN:.0f} or more"
        )
    begins = reference_time[changes]
    inside = (time >= begins[0] - BEFORE) & (time <= reference_time[-1])
    apart = bool(len(begins) <= STEPS_MAX and np.diff(begins).min(initial=math.inf) > APART)
    if apart:
        since = time[:, None] - begins
        inside &= ((since >= -BEFORE) & (since <= AFTER)).any(axis=1)
    origin = begins[0]  # epoch seconds would lose microseconds
    at, shown = time[inside] - origin, signal[inside]
    if len(at) < SAMPLES_MIN:
        raise MeasurementError(
            f"{len(at)} samples since the first step of the reference, needed are {SAMPLES_MIN}"
        )
    if not np.isfinite(shown).all():
        raise MeasurementError("the recording has values that are not finite; repair or repeat it")
    held = np.concatenate([reference[:1], reference[changes]])
    return _Steps(at, shown, begins - origin, held, apart)


def _fitted(steps: _Steps, shape: Array) -> tuple[Array, Array, Array]:
    """Return the logarithm of the time constant with the dead times, what is left, its Jacobian.

    Args:
        shape: (N,) the speeds without their mean.
    """
    from scipy.optimize import least_squares

    low, high = (math.log(bound) for bound in BOUNDS)

    def miss(unknowns: Array) -> Array:
        begins = steps.begins + unknowns[1:]
        course = _course(steps.at, begins, steps.held, math.exp(unknowns[0]))
        course -= course.mean()  # gain and offset are those that fit best
        left: Array = course * float(course @ shape / (course @ course)) - shape
        return left

    def fitted(start: Array) -> Any:
        bounds = [[low, high], *([DEAD_TIME] * (len(start) - 1))]
        scales = [0.1, *([0.001] * (len(start) - 1))]
        return least_squares(
            miss,
            start,
            bounds=tuple(zip(*bounds, strict=True)),
            x_scale=scales,
            diff_step=1e-4,
            xtol=1e-9,
            ftol=1e-10,
        )

    guesses = [
        np.array((lag, late))
        for lag in np.linspace(low, high, 12)[1:-1]
        for late in (0.002, 0.01, 0.03)
    ]
    found = fitted(min(guesses, key=lambda one: float(np.square(miss(one)).sum())))
    if steps.apart:
        found = fitted(np.concatenate([found.x[:1], np.full(len(steps.begins), found.x[1])]))
    return found.x, found.fun, found.jac


def _course(time: Array, begins: Array, held: Array, seconds: float) -> Array:
    """Return the lagged reference at `time` (N,); the references `held` (K + 1,) begin at `begins`
    (K,), the first of them at minus infinity.
    """
    begins = np.concatenate([[-math.inf], begins])
    at_begin = np.empty(len(held))
    at_begin[0] = held[0]
    for k in range(1, len(held)):
        since = begins[k] - begins[k - 1]
        at_begin[k] = held[k - 1] + (at_begin[k - 1] - held[k - 1]) * math.exp(-since / seconds)
    part = np.searchsorted(begins, time, side="right") - 1
    since_begin = np.where(part > 0, time - begins[part], 0.0)
    out: Array = held[part] + (at_begin[part] - held[part]) * np.exp(-since_begin / seconds)
    return out
