"""Findings from poses that IMU or motors do not explain: what is wrong, and by how much.

The accelerometer, the motors and the poses are three witnesses of one motion: the two that agree
say which one is wrong (`residuals`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from console.evaluation.findings import Array, Finding, Parameters, Spans, Topics
from extensions.explanation.blocks import blocks, has, longest, means
from extensions.explanation.residuals import STEADY, STEP, WINDOW, Window, windows
from flight_log.fields import TORQUE_B, TRACKED, axes
from quadrotor.constants import GRAVITY

ACCELEROMETER = 0.2
"""Limit in m/s² of what the accelerometer reads besides what poses and motors show."""
TILTED = 0.3
"""Limit in m/s² of a horizontal acceleration that both IMU and motors miss: 1.8° of tilt."""
THRUST = 0.25
"""Limit in m/s² of the thrust over the mass that flies without an effect, or lacks."""
SIDEWAYS = 0.3
"""Limit in m/s² of a horizontal force over the mass."""
GYROSCOPE = 0.5
"""Limit in deg/s between gyroscope and poses; 150 simulated flights without such a fault reach
0.25."""
DELAY = 0.02
"""Limit in s between the poses and their stamps."""
SCALE = 0.04
"""Limit of the scale of the poses, minus 1."""
DRAG = 0.4
"""Limit in 1/s of a force against the velocity, over the mass, beyond the model's drag."""
PUSHED = 0.1
"""The same of a fit by the motors, which gusts disturb."""
PRECISE = 0.006
"""Largest rms in m of what a fit leaves that shows a delay or a scale."""
MOVING = 0.3
"""Least rms of the places in m for a delay, a scale or drag to show."""
HEAVY = ("more mass (a payload, a slung load)", "motors that are all weaker", "sinking air")
LIGHT = ("less mass", "motors that are all stronger", "rising air")
"""Causes of a thrust that is larger or smaller than the model says."""
CENTRE = 0.005
"""Limit in m of the lever that the mean torque makes of the thrust."""


def motion(topics: Topics, parameters: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find the causes that the residuals of poses against IMU and motors show."""
    found = [one for one in windows(topics, parameters, spans) if one.imu.rms < STEADY]
    if not found:
        return
    yield from _accelerometer(found)
    yield from _tracker(found)
    yield from _forces(found)
    turning = [float(np.degrees(np.abs(one.turning_b).max())) for one in found]
    yield from _of(
        kind="gyroscope_off",
        found=found,
        values=turning,
        limit=GYROSCOPE,
        claim=lambda most, _: f"The gyroscope turned {most:.1f}°/s more or less than the poses.",
        alike=lambda _: ("a changed bias of the gyroscope", "its scale", "poses that turn slowly"),
        signals=("imu/angular_velocity.x", "imu/angular_velocity.y", "imu/angular_velocity.z"),
        evidence=("rate of the gyroscope besides that of the poses", "°/s"),
    )


def _accelerometer(found: Sequence[Window]) -> Iterator[Finding]:
    """Find readings of the accelerometer that neither poses nor motors have."""
    off = [_own(one.imu.ending_w, one.motors.ending_w) if one.motors else 0.0 for one in found]

    def claim(most: float, heaviest: Window) -> str:
        x, y, z = -heaviest.imu.ending_b
        grew = off[-1] - off[0] > 0.5 * most
        return (
            f"The accelerometer read {x:+.2f}, {y:+.2f}, {z:+.2f} m/s² (body axes) more than poses "
            f"and motors show{', and it grew' if grew else ''}."
        )

    def alike(heaviest: Window) -> tuple[str, ...]:
        x, y, z = -heaviest.imu.ending_b
        turned = np.degrees(np.hypot(x, y) / GRAVITY)
        scale = f"a wrong scale ({100 * z / GRAVITY:+.0f} % on z)"
        return "a bias", scale, f"a sensor that is turned by {turned:.1f}°"

    yield from _of(
        kind="accelerometer_off",
        found=found,
        values=off,
        limit=ACCELEROMETER,
        claim=claim,
        alike=alike,
        signals=axes("imu/linear_acceleration"),
        evidence=("acceleration read besides that of poses and motors", "m/s²"),
    )


def _own(one: Array, other: Array) -> float:
    """Return how much one source lacks that the other does not lack as well."""
    return float(min(np.linalg.norm(one), np.linalg.norm(one - other)))


def _tracker(found: Sequence[Window]) -> Iterator[Finding]:
    """Find poses that are turned, too large or too small, or not of their time."""
    yield from _tilted(found)
    trusted = [
        one.spread > MOVING
        and one.imu.rms < PRECISE
        and bool(np.linalg.norm(one.imu.acceleration_w[2:]) < ACCELEROMETER)
        for one in found
    ]
    yield from _scale(found, trusted)
    yield from _stamps(found, trusted)


def _tilted(found: Sequence[Window]) -> Iterator[Finding]:
    """Find a vertical that IMU and motors do not have."""
    level = [
        float(min(np.hypot(*one.imu.acceleration_w[:2]), np.hypot(*one.motors.acceleration_w[:2])))
        if one.motors
        and np.linalg.norm((one.imu.acceleration_w - one.motors.acceleration_w)[:2])
        < 0.5 * TILTED + 0.3 * np.hypot(*one.imu.acceleration_w[:2])
        else 0.0
        for one in found
    ]
    yield from _of(
        kind="tracker_tilted",
        found=found,
        values=level,
        limit=TILTED,
        claim=lambda most, _: (
            f"The tracker's vertical was {np.degrees(most / GRAVITY):.1f}° off: IMU and "
            "motors agree with each other and not with its poses."
        ),
        alike=lambda _: ("a tilted world", "axes of the body that are tilted in the tracker"),
        signals=axes("imu/linear_acceleration"),
        evidence=("horizontal acceleration that neither IMU nor motors have", "m/s²"),
    )


def _scale(found: Sequence[Window], trusted: Sequence[bool]) -> Iterator[Finding]:
    """Find distances that the accelerometer does not have, in the windows that can be trusted."""
    scale = [one.imu.scale if ok else 0.0 for one, ok in zip(found, trusted, strict=True)]
    yield from _of(
        kind="tracker_scale",
        found=found,
        values=np.abs(scale),
        limit=SCALE,
        claim=lambda _, one: (
            f"The tracker's distances were {100 * one.imu.scale:+.1f} % off against the "
            "accelerometer."
        ),
        alike=lambda _: (
            "a wrong length in the tracker's calibration",
            "a wrong scale of the accelerometer on x and y",
        ),
        signals=tuple(f"tracker_pose/{name}" for name in TRACKED),
        evidence=("scale of the poses minus 1", ""),
    )


def _stamps(found: Sequence[Window], trusted: Sequence[bool]) -> Iterator[Finding]:
    """Find stamps that are not those of the poses, in the windows that can be trusted."""
    delay = [
        one.imu.delay if ok and abs(one.imu.scale) < SCALE else 0.0
        for one, ok in zip(found, trusted, strict=True)
    ]
    yield from _of(
        kind="tracker_stamps",
        found=found,
        values=np.abs(delay),
        limit=DELAY,
        claim=lambda _, one: (
            f"The poses were of a time {1e3 * abs(one.imu.delay):.0f} ms "
            f"{'before' if one.imu.delay > 0.0 else 'after'} their stamps: the tracker's delay is "
            "another than its stamps say."
        ),
        signals=tuple(f"tracker_pose/{name}" for name in TRACKED),
        evidence=("time of the stamps minus that of the motion", "s"),
    )


def _forces(found: Sequence[Window]) -> Iterator[Finding]:
    """Find forces that poses and IMU show and the commanded thrust does not."""
    known = [one for one in found if one.motors is not None and one.motors.rms < PUSHED]
    if not known:
        return
    lacking = np.array([one.motors.acceleration_w for one in known if one.motors])
    felt = np.array([one.imu.acceleration_w for one in known])
    up = np.array([_own(one[2:], two[2:]) for one, two in zip(lacking, felt, strict=True)])
    aside = [_own(one[:2], two[:2]) for one, two in zip(lacking, felt, strict=True)]
    yield from _of(
        kind="thrust_off",
        found=known,
        values=up,
        limit=THRUST,
        claim=lambda _, one: _thrust_claim(-float(lacking[known.index(one), 2])),
        alike=lambda one: HEAVY if lacking[known.index(one), 2] < 0.0 else LIGHT,
        signals=("thrust", "mass"),
        evidence=("acceleration that the thrust lacks or has too much", "m/s²"),
    )
    yield from _of(
        kind="outside_force",
        found=known,
        values=aside,
        limit=SIDEWAYS,
        claim=lambda most, _: (
            f"A sideways force of {most:.1f} m/s² times the mass acted besides the thrust."
        ),
        alike=lambda _: ("wind", "a wall", "a cable", "thrust that is not along z_B"),
        signals=axes("disturbance"),
        evidence=("horizontal acceleration besides thrust", "m/s²"),
    )
    drags = [one.motors.drag if one.motors and one.spread > MOVING else 0.0 for one in known]
    yield from _of(
        kind="drag_off",
        found=known,
        values=np.abs(drags),
        limit=DRAG,
        claim=lambda most, _: (
            f"A force of {most:.2f}/s times mass and velocity acted against the motion "
            "besides the drag of the model (`model.drag`)."
        ),
        signals=axes("state.velocity"),
        evidence=("force over mass and velocity", "1/s"),
    )


def _thrust_claim(excess: float) -> str:
    share, more = 100.0 * abs(excess) / GRAVITY, "more" if excess > 0.0 else "less"
    return f"The vehicle needed {share:.0f} % {more} thrust than its mass and motors' model say."


def centre(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find a mean torque that holds a centre of mass beside the rotors' middle."""
    if not has(topics, "actuators", "thrust", *TORQUE_B[:2]):
        return
    series = topics["actuators"]
    time, mean = blocks(series.time, series.rows(("thrust", *TORQUE_B[:2])), spans, means)
    lever = np.hypot(mean[:, 1], mean[:, 2]) / np.maximum(mean[:, 0], 1e-3)
    lever = np.where(mean[:, 0] > 0.0, lever, 0.0)
    for start, end in longest(time, lever, CENTRE, 3):
        inside = (time >= start) & (time < end)
        most = float(np.median(lever[inside]))
        torque = np.median(mean[inside, 1:], axis=0)
        x, y = np.round(1e3 * torque[::-1] / np.median(mean[inside, 0])).astype(int)
        yield Finding(
            kind="centre_off",
            weight=most / CENTRE,
            start=start,
            end=end,
            claim="A steady torque held the vehicle level, as of a centre of mass that is about "
            f"{-x:+d} mm along x_B and {y:+d} mm along y_B from the rotors' middle.",
            alike=("a centre of mass beside the rotors' middle", "two weaker motors"),
            signals=("torque.x", "torque.y"),
            label="mean torque over thrust",
            unit="m",
            limit=CENTRE,
            time=time,
            values=lever,
        )


def _of(
    kind: str,
    found: Sequence[Window],
    values: Sequence[float] | Array,
    limit: float,
    claim: Callable[[float, Window], str],
    signals: tuple[str, ...],
    evidence: tuple[str, str],
    alike: Callable[[Window], tuple[str, ...]] = lambda _: (),
) -> Iterator[Finding]:
    """Yield the heaviest stretch of windows beyond a limit, if there is one."""
    starts = np.array([one.start for one in found])
    size = np.asarray(values, np.float64)
    for start, _ in longest(starts, size, limit, 2, STEP):
        over = [k for k in range(len(found)) if starts[k] >= start and size[k] > limit]
        usual = min(over, key=lambda k: abs(size[k] - np.median(size[over])))
        yield Finding(
            kind=kind,
            weight=float(np.median(size[over])) / limit,
            start=start,
            end=float(starts[over[-1]]) + WINDOW,
            claim=claim(float(size[usual]), found[usual]),
            alike=alike(found[usual]),
            signals=signals,
            label=evidence[0],
            unit=evidence[1],
            limit=limit,
            time=starts + WINDOW / 2,
            values=size,
        )
