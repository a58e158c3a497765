"""The few rotations the page needs, in plain Python: numba is too slow to import here."""

from __future__ import annotations

import math
from typing import Any

Vector = tuple[float, float, float]


def roll_pitch_yaw(quaternion: Any) -> Vector:
    """Return angles (rad) of R = Rz(yaw) Ry(pitch) Rx(roll) from a geometry_msgs/Quaternion."""
    w, x, y, z = quaternion.w, quaternion.x, quaternion.y, quaternion.z
    sine = min(1.0, max(-1.0, 2.0 * (w * y - z * x)))
    return (
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(sine),
        math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def rotate(quaternion: Any, vector: Any) -> Vector:
    """Return r v, with R the rotation of a unit geometry_msgs/Quaternion (v + 2w q×v + 2
    q×(q×v)).
    """
    w, x, y, z = quaternion.w, quaternion.x, quaternion.y, quaternion.z
    tx = 2.0 * (y * vector.z - z * vector.y)
    ty = 2.0 * (z * vector.x - x * vector.z)
    tz = 2.0 * (x * vector.y - y * vector.x)
    return (
        vector.x + w * tx + y * tz - z * ty,
        vector.y + w * ty + z * tx - x * tz,
        vector.z + w * tz + x * ty - y * tx,
    )
