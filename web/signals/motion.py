"""State, reference, tracking error and truth: world axes, degrees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from quadrotor.plain_rotations import roll_pitch_yaw, rotate
from web.signals.signal import Source, one, quaternion, vector, xyz


def _state(m: Any) -> Sequence[float]:
    pose, twist = m.pose.pose, m.twist.twist
    q = quaternion(pose.orientation)
    return (
        *vector(pose.position),
        *rotate(q, vector(twist.linear)),  # body axes to world axes
        *(math.degrees(a) for a in roll_pitch_yaw(*q)),
        *(math.degrees(a) for a in vector(twist.angular)),
    )


def _reference(m: Any) -> Sequence[float]:
    return (*vector(m.position), *vector(m.velocity), *vector(m.acceleration), math.degrees(m.yaw))


def _tracking(state: Any, reference: Any) -> Sequence[float]:
    p, r = state.pose.pose.position, reference.position
    error = (p.x - r.x, p.y - r.y, p.z - r.z)
    yaw = roll_pitch_yaw(*quaternion(state.pose.pose.orientation))[2] - reference.yaw
    return (*error, math.hypot(*error), math.degrees(math.remainder(yaw, math.tau)))


def _truth(state: Any, truth: Any) -> Sequence[float]:
    p, t = state.pose.pose.position, truth.pose.pose.position
    v = rotate(quaternion(state.pose.pose.orientation), vector(state.twist.twist.linear))
    u = rotate(quaternion(truth.pose.pose.orientation), vector(truth.twist.twist.linear))
    return (*vector(t), 1e3 * math.dist((p.x, p.y, p.z), (t.x, t.y, t.z)), math.dist(v, u))


MOTION = (
    Source(
        ("state",),
        (
            *xyz("state.position", "position", "m", "state"),
            *xyz("state.velocity", "velocity", "m/s", "state"),
            *(one(f"state.{a}", a, "°", "attitude", "state") for a in ("roll", "pitch", "yaw")),
            *xyz("state.rate", "body rate", "°/s", "state"),
        ),
        _state,
        covers=("state.pose.pose.position", "state.twist.twist.angular"),
    ),
    Source(
        ("reference",),
        (
            *xyz("reference.position", "reference position", "m", "reference"),
            *xyz("reference.velocity", "reference velocity", "m/s", "reference"),
            *xyz("reference.acceleration", "reference acceleration", "m/s²", "reference"),
            one("reference.yaw", "yaw", "°", "reference position", "reference"),
        ),
        _reference,
        covers=(
            "reference.position",
            "reference.velocity",
            "reference.acceleration",
            "reference.yaw",
        ),
    ),
    Source(
        ("state", "reference"),
        (
            *xyz("error.position", "tracking error", "m", "state"),
            one("error.distance", "distance", "m", "tracking error", "state"),
            one("error.yaw", "yaw", "°", "tracking error", "state"),
        ),
        _tracking,
    ),
    Source(
        ("state", "truth"),
        (
            *xyz("truth.position", "truth position", "m", "truth"),
            one("truth.position_error", "position", "mm", "estimate against truth", "truth"),
            one("truth.velocity_error", "velocity", "m/s", "estimate against truth", "truth"),
        ),
        _truth,
        covers=("truth.pose.pose.position",),
    ),
)
