"""The response of the actual value to one step of the set-point, in the usual figures.

    delay          until half of the step is done
    rise           from 10 to 90 % of it
    overshoot      beyond the set-point, % of the step
    settling       until it stays within 5 % of the step about the set-point
    steady error   set-point minus actual, mean of the last fifth
    rms error      of set-point minus actual, over the whole interval

The step goes from the actual value at the edge to the new set-point: an earlier error is not part
of it. Figures that the response does not reach are None.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quadrotor.records import Array

BAND = 0.05
LAST_SHARE = 0.2
STAYS = 0.1
"""Share of the interval for which it has to stay in the band to be settled."""


@dataclass(frozen=True, slots=True)
class StepResponse:
    """Figures of a step response: times in s, overshoot in % of the step, errors in the unit of the
    values.
    """

    delay: float | None
    rise: float | None
    overshoot: float
    settling: float | None
    steady_error: float
    rms_error: float


FIGURES = ("delay", "rise", "overshoot", "settling", "steady_error", "rms_error")


def step_response(time: Array, actual: Array, start: float, target: float) -> StepResponse:
    """Compute the step response of the interval from one edge to the next.

    Args:
        time: s since the edge, shape (N,), rising.
        actual: shape (N,).
        start: the actual value at the edge.
        target: the set-point from the edge on; not `start`.
    """
    done = (actual - start) / (target - start)
    half, tenth, most = (_reaches(time, done, level) for level in (0.5, 0.1, 0.9))
    last = actual[time >= time[0] + (1.0 - LAST_SHARE) * (time[-1] - time[0])]
    return StepResponse(
        delay=half,
        rise=most - tenth if most is not None and tenth is not None else None,
        overshoot=max(0.0, 100.0 * (float(done.max()) - 1.0)),
        settling=_settles(time, np.abs(done - 1.0)),
        steady_error=target - float(last.mean()),
        rms_error=float(np.sqrt(np.mean((target - actual) ** 2))),
    )


def _reaches(time: Array, done: Array, level: float) -> float | None:
    """Return when the level is first reached (s), interpolated between samples; None when it never
    is.
    """
    at = int(np.argmax(done >= level))
    if done[at] < level:
        return None
    return _crossing(time, done, at, level) if at else float(time[0])


def _settles(time: Array, off: Array) -> float | None:
    """Return the time from which it stays within the band (s); None when that is not seen."""
    outside = np.flatnonzero(off > BAND)
    if not len(outside):
        return float(time[0])
    at = int(outside[-1]) + 1
    if at >= len(time) or time[-1] - time[at] < STAYS * (time[-1] - time[0]):
        return None
    return _crossing(time, off, at, BAND)


def _crossing(time: Array, values: Array, at: int, level: float) -> float:
    """Return when the level is crossed between samples at - 1 and at (s), interpolated."""
    before, after = float(values[at - 1]), float(values[at])
    share = (level - before) / (after - before) if after != before else 1.0
    return float(time[at - 1] + share * (time[at] - time[at - 1]))
