"""Signals of state, reference, tracking error and truth: world axes, degrees."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from quadrotor.plain_rotations import roll_pitch_yaw_of_rows, rotate
from web.signals.signal import Array, Signal, Source, one, scaled, xyz

DEGREES = math.degrees(1.0)
ATTITUDE = tuple(f"pose.pose.orientation.{axis}" for axis in "wxyz")
VELOCITY = tuple(f"twist.twist.linear.{axis}" for axis in "xyz")
"""Linear velocity, in body axes."""
SINKS, SLIDES, RISES = 0.1, 0.02, 0.1
"""Reference of a landing: speed down, in m/s, from which on a descent that is not flown shows the
ground; speed sideways and acceleration up, in m/s and m/s², that it has at most."""
SUNK = 0.3
"""Distance in m by which such a reference sinks at most until the vehicle has detected the
touch-down; a vehicle that is further above does not descend, and that is an error."""
STOPPED = 0.3
"""Share of a commanded descent below which it is not flown, as for the vehicle's own detection of
a touch-down."""


def _signals(prefix: str, group: str, unit: str, names: Sequence[str], topic: str) -> list[Signal]:
    return [Signal(f"{prefix}.{name}", name, unit, group, topic) for name in names]


def _names(prefix: str) -> list[str]:
    return [f"{prefix}.{axis}" for axis in "xyz"]


def _state(*columns: Array) -> Sequence[Array]:
    q, velocity_b = columns[:4], columns[4:]
    angles = roll_pitch_yaw_of_rows(np.stack(q, axis=1)).T
    return (*rotate(q, velocity_b), *(angle * DEGREES for angle in angles))


def _tracking(*inputs: Array) -> Sequence[Array]:
    """Return the tracking error in mm and degrees, which has no value on the ground.

    There the reference is the vehicle's own position, or, at a touch-down, sinks on for a moment
    below a vehicle that has stopped.
    """
    x, y, z, yaw, climb, *rest = inputs
    *reference, reference_yaw = rest[:4]
    velocity, acceleration = rest[4:7], rest[7:]
    error = (x - reference[0], y - reference[1], z - reference[2])
    turn = (yaw - reference_yaw) / DEGREES
    wrapped = np.atan2(np.sin(turn), np.cos(turn))
    follows = (error[0] == 0.0) & (error[1] == 0.0) & (error[2] == 0.0)
    sinks = (velocity[2] < -SINKS) & (acceleration[2] < RISES)
    is_straight = np.hypot(*velocity[:2]) + np.hypot(*acceleration[:2]) < SLIDES
    stands = (climb > STOPPED * velocity[2]) & (error[2] < SUNK)
    grounded = follows | (sinks & is_straight & stands)
    values = (*(1e3 * one for one in (*error, _length(*error))), wrapped * DEGREES)
    return [np.where(grounded, np.nan, one) for one in values]


def _truth(*inputs: Array) -> Sequence[Array]:
    truth = (*inputs[7:10], *rotate(inputs[:4], inputs[4:7]))  # position, velocity
    error = [of_state - of_truth for of_state, of_truth in zip(inputs[10:], truth, strict=True)]
    return (1e3 * _length(*error[:3]), _length(*error[3:]))


def _length(x: Array, y: Array, z: Array) -> Array:
    length: Array = np.sqrt(x * x + y * y + z * z)
    return length


MOTION = (
    scaled(*xyz("state.position", "position", "m", "state/pose.pose.position")),
    Source(
        "state",
        (*ATTITUDE, *VELOCITY),
        (
            *_signals("state.velocity", "velocity", "m/s", "xyz", "state"),
            *_signals("state", "attitude", "°", ("roll", "pitch", "yaw"), "state"),
        ),
        function=_state,
    ),
    scaled(*xyz("state.rate", "body rate", "°/s", "state/twist.twist.angular", DEGREES)),
    scaled(
        *xyz("reference.position", "reference position", "m", "reference/position"),
        *xyz("reference.velocity", "reference velocity", "m/s", "reference/velocity"),
        *xyz("reference.acceleration", "reference acceleration", "m/s²", "reference/acceleration"),
        one("reference.yaw", "yaw", "°", "reference position", "reference/yaw", DEGREES),
    ),
    Source(
        "state",
        (),
        (
            *_signals("error.position", "tracking error", "mm", "xyz", "state"),
            Signal("error.distance", "distance", "mm", "tracking error", "state"),
            Signal("error.yaw", "yaw", "°", "tracking error", "state"),
        ),
        function=_tracking,
        inputs=(
            *_names("state.position"),
            "state.yaw",
            "state.velocity.z",
            *_names("reference.position"),
            "reference.yaw",
            *_names("reference.velocity"),
            *_names("reference.acceleration"),
        ),
    ),
    scaled(*xyz("truth.position", "truth position", "m", "truth/pose.pose.position")),
    Source(
        "truth",
        (*ATTITUDE, *VELOCITY),
        (
            Signal("truth.position_error", "position", "mm", "estimate against truth", "truth"),
            Signal("truth.velocity_error", "velocity", "m/s", "estimate against truth", "truth"),
        ),
        function=_truth,
        inputs=(*_names("truth.position"), *_names("state.position"), *_names("state.velocity")),
    ),
)
