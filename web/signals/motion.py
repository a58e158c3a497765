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


def _signals(prefix: str, group: str, unit: str, names: Sequence[str], topic: str) -> list[Signal]:
    return [Signal(f"{prefix}.{name}", name, unit, group, topic) for name in names]


def _names(prefix: str) -> list[str]:
    return [f"{prefix}.{axis}" for axis in "xyz"]


def _state(*columns: Array) -> Sequence[Array]:
    q, velocity_b = columns[:4], columns[4:]
    angles = roll_pitch_yaw_of_rows(np.stack(q, axis=1)).T
    return (*rotate(q, velocity_b), *(angle * DEGREES for angle in angles))


def _tracking(*inputs: Array) -> Sequence[Array]:
    x, y, z, yaw, *reference, reference_yaw = inputs
    error = (x - reference[0], y - reference[1], z - reference[2])
    turn = (yaw - reference_yaw) / DEGREES
    wrapped = np.atan2(np.sin(turn), np.cos(turn))
    return (*error, _length(*error), wrapped * DEGREES)


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
            *_signals("error.position", "tracking error", "m", "xyz", "state"),
            Signal("error.distance", "distance", "m", "tracking error", "state"),
            Signal("error.yaw", "yaw", "°", "tracking error", "state"),
        ),
        function=_tracking,
        inputs=(
            *_names("state.position"),
            "state.yaw",
            *_names("reference.position"),
            "reference.yaw",
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
