"""Forces and torques that last for a moment, too short for the windows of `residuals`.

The change of velocity and rate over a quarter of a second is compared with what thrust and torque
were commanded. A force counts where accelerometer and poses both show it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from console.evaluation.findings import Array, Finding, Parameters, Spans, Topics, stretches
from extensions.explanation.blocks import SETTLING, has, longest, number, tilts
from extensions.explanation.residuals import Motion, integrated, motion_of
from flight_log.fields import RATE, TORQUE_B, TRACKED, axes

LENGTH, STEP = 0.25, 0.125
"""Length of a change and time between two, in s."""
EDGE = 0.03
"""Time in s about its ends over which rates and places are averaged, to both sides."""
TURN, PUSH = (1.0, 3.0), (0.3, 0.75)
"""Least and largest limits in rad/s² and m/s² beside what the motors were commanded."""
USUAL = 5.0
"""Multiple of a flight's usual changes that is the limit between those: gusts make them larger."""
LEAST = 0.55
"""Least force over the mass, in m/s²: gusts of the rough world reach 0.53."""
ALONE = (0.5, 1.2)
"""Least and largest limit in m/s² of what the poses alone show."""
PRECISE = 0.3
"""Largest standard deviation in m/s² of the poses' acceleration with which they are a witness."""
TURNING_OVER = 60.0
"""Tilt in deg of a vehicle that turns over."""
LEAST_POSES = 4
"""Number of poses about each end, below which they are none."""


def transients(topics: Topics, parameters: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find torques and forces that the motors were not commanded, from a quarter of a second on."""
    time, tilt = tilts(topics)
    over = time[tilt > TURNING_OVER]
    longer = []
    for start, end in spans:  # what turned a vehicle over acts in its last moment
        fall = over[(over > end) & (over < end + SETTLING)]
        settling = min(SETTLING, 0.25 * (end - start))  # of a flight of some seconds, less
        last = float(fall[0]) if len(fall) else end + 0.25 * settling
        longer.append((start - 0.5 * settling, last))
    yield from _torques(topics, parameters, longer)
    motion = motion_of(topics, parameters)
    if motion is not None and motion.pushed is not None:
        yield from _forces(motion, motion.pushed, longer)


def _torques(topics: Topics, parameters: Parameters, spans: Spans) -> Iterator[Finding]:
    if not has(topics, "imu", *RATE) or not has(topics, "actuators", *TORQUE_B):
        return
    inertia = np.array([number(parameters, f"model.inertia_{a}", 0.0) for a in ("xx", "yy", "zz")])
    lag = number(parameters, "model.motor_time_constant", 0.0)
    if not (inertia > 0.0).all():
        return
    imu, actuators = topics["imu"], topics["actuators"]
    time, rates = imu.time, imu.rows(RATE).astype(np.float64)
    given = [np.interp(time - lag, actuators.time, actuators.values(one)) for one in TORQUE_B]
    turned = integrated(time, np.stack(given, axis=1) / inertia)
    # Where the board holds the angles itself, its torques are not in the log.
    known = stretches(actuators.time, np.linalg.norm(actuators.rows(TORQUE_B), axis=1) > 0.0)
    starts = _starts([(max(a, c), min(b, d)) for a, b in spans for c, d in known])
    rows = [_change(time, rates, turned, start) for start in starts]
    excess = np.array([row if row is not None else np.zeros(3) for row in rows]).reshape(-1, 3)
    excess -= np.median(excess, axis=0, keepdims=True) if len(excess) else 0.0  # what always acts
    size = np.linalg.norm(excess, axis=1)
    limit = _limit(size, TURN)
    for start, end in longest(starts, size, limit, 2, STEP):
        worst = int(np.argmax(np.where((starts >= start) & (starts < end), size, 0.0)))
        x, y, z = 1e3 * inertia * excess[worst]
        yield _finding(
            kind="outside_torque",
            figures=(float(size[worst]) / limit, start, end + LENGTH - STEP),
            claim=f"For {end - start + LENGTH - STEP:.1f} s a torque acted that the motors were "
            f"not commanded, up to {x:+.0f}, {y:+.0f}, {z:+.0f} mN m (body axes).",
            alike=(
                "a motor that gives less or more",
                "a centre of mass that moved",
                "a blow",
                "a gust",
            ),
            signals=("torque.x", "torque.y", *(f"imu/{name}" for name in RATE)),
            evidence=("angular acceleration that was not commanded", "rad/s²", limit),
            time=starts,
            values=size,
        )


def _change(time: Array, rates: Array, turned: Array, start: float) -> Array | None:
    """Return the mean angular acceleration (3,) that was not commanded; None across a gap."""
    edges = np.searchsorted(time, [start - EDGE, start + EDGE])
    ends = np.searchsorted(time, [start + LENGTH - EDGE, start + LENGTH + EDGE])
    if ends[1] >= len(time) or edges[1] <= edges[0] or ends[1] <= ends[0]:
        return None
    i, j = np.searchsorted(time, [start, start + LENGTH])
    lasted = time[j] - time[i]
    if not 0.8 * LENGTH < lasted < 1.2 * LENGTH:
        return None
    change = rates[slice(*ends)].mean(axis=0) - rates[slice(*edges)].mean(axis=0)
    found: Array = (change - turned[j] + turned[i]) / lasted
    return found


def _forces(motion: Motion, pushed: Array, spans: Spans) -> Iterator[Finding]:
    starts = _starts(spans)
    felt, made = integrated(motion.time, motion.felt), integrated(motion.time, pushed)
    excess = np.full((len(starts), 2, 3), np.nan)
    for k, start in enumerate(starts):
        i, j = np.searchsorted(motion.time, [start, start + LENGTH])
        if j >= len(motion.time):
            continue
        lasted = motion.time[j] - motion.time[i]
        if lasted < 0.8 * LENGTH:
            continue
        seen = _velocity(motion, start + LENGTH) - _velocity(motion, start)
        by_motors = (made[j] - made[i]) / lasted
        excess[k] = (felt[j] - felt[i]) / lasted - by_motors, seen / lasted - by_motors
    known = np.isfinite(excess).all(axis=(1, 2))
    if known.sum() < 4:
        return
    excess -= np.median(excess[known], axis=0)
    scatter = 1.48 * np.median(np.abs(excess[known][:, 1] - excess[known][:, 0]), axis=0).max()
    if scatter > PRECISE:
        return
    size = np.linalg.norm(excess, axis=2)
    apart = np.linalg.norm(excess[:, 0] - excess[:, 1], axis=1)
    by_motors = np.linalg.norm(excess[:, 1], axis=1)
    yield from _jumped(starts, np.minimum(apart, by_motors), known)
    both = np.where(known & (apart < 0.5 * size.max(axis=1)), size.min(axis=1), 0.0)
    limit = _limit(both, PUSH)
    for start, end in longest(starts, both, limit, 2, STEP):
        inside = (starts >= start) & (starts < end)
        worst = int(np.argmax(np.where(inside, both, 0.0)))
        x, y, z = excess[worst, 0]
        is_up = abs(z) > np.hypot(x, y)
        if both[worst] < LEAST:
            continue
        yield _finding(
            kind="thrust_off" if is_up else "outside_force",
            figures=(float(both[worst]) / limit, start, end + LENGTH - STEP),
            claim=f"For {end - start + LENGTH - STEP:.1f} s a force acted beside the commanded "
            f"thrust, up to {x:+.1f}, {y:+.1f}, {z:+.1f} m/s² times the mass (world axes).",
            alike=("a push", "a gust", "motors that give less or more")
            if is_up
            else ("a push", "a gust", "a wall", "a cable"),
            signals=("thrust", *axes("disturbance")),
            evidence=("acceleration beside the commanded thrust", "m/s²", limit),
            time=starts,
            values=both,
        )


def _limit(size: Array, between: tuple[float, float]) -> float:
    least, largest = between
    usual = 1.48 * float(np.median(size)) if len(size) else 0.0
    return min(largest, max(least, USUAL * usual))


def _jumped(starts: Array, apart: Array, known: Array) -> Iterator[Finding]:
    """Find poses that jump or move although neither accelerometer nor motors show it."""
    size = np.where(known, apart, 0.0)
    limit = _limit(apart[known], ALONE)
    for start, end in longest(starts, size, limit, 1, STEP):
        most = float(size[(starts >= start) & (starts < end)].max())
        yield _finding(
            kind="tracker_jumped",
            figures=(most / limit, start, end + LENGTH - STEP),
            claim=f"The tracker's poses moved with up to {most:.1f} m/s² that neither the "
            "accelerometer nor the motors had.",
            alike=("a jump", "another body", "axes or a scale that changed", "stamps that changed"),
            signals=tuple(f"tracker_pose/{name}" for name in TRACKED),
            evidence=("acceleration that the poses alone show", "m/s²", limit),
            time=starts,
            values=size,
        )


def _velocity(motion: Motion, at: float) -> Array:
    """Return the velocity (3,) of the poses about a time; NaN without enough of them."""
    first, last = np.searchsorted(motion.times, [at - 2.0 * EDGE, at + 2.0 * EDGE])
    if last - first < LEAST_POSES:
        return np.full(3, np.nan)
    t = motion.times[first:last] - motion.times[first:last].mean()
    found: Array = t @ motion.places[first:last] / (t @ t)
    return found


def _starts(spans: Spans) -> Array:
    return np.concatenate([[], *(np.arange(start, end - LENGTH, STEP) for start, end in spans)])


def _finding(
    kind: str,
    figures: tuple[float, float, float],
    claim: str,
    alike: tuple[str, ...],
    signals: tuple[str, ...],
    evidence: tuple[str, str, float],
    time: Array,
    values: Array,
) -> Finding:
    weight, start, end = figures
    label, unit, limit = evidence
    return Finding(
        kind=kind,
        weight=weight,
        start=start,
        end=end,
        claim=claim,
        alike=alike,
        signals=signals,
        label=label,
        unit=unit,
        limit=limit,
        time=time + LENGTH / 2,
        values=values,
    )
