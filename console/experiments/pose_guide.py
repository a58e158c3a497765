"""The pose in which a vehicle is to be held next, in words for a person."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from estimation.calibration.accelerometer import FACES
from quadrotor.records import Array

SMALL = math.radians(8.0)
"""Largest tilt, in rad, that is not mentioned."""


def spread_poses(count: int, tilt: float) -> Array:
    """Return directions of world z in body axes, shape (count, 3), within `tilt` (rad) of upright.

    The first is upright, a third of the others lean by half of the tilt, the rest by all of it,
    each ring evenly spread.
    """
    near = (count - 1) // 3
    poses = [(0.0, 0.0, 1.0)]
    for number, lean, turn in ((near, 0.5 * tilt, 0.5), (count - 1 - near, tilt, 0.0)):
        for k in range(number):
            azimuth = 2.0 * math.pi * (k + turn) / number
            out = math.sin(lean)
            poses.append((out * math.cos(azimuth), out * math.sin(azimuth), math.cos(lean)))
    return np.array(poses)


def farthest(wanted: Array, taken: Sequence[Array]) -> Array:
    """Return the direction of `wanted` (N, 3) that is farthest from all in `taken`; the first when
    `taken` is empty.
    """
    if not taken:
        return np.array(wanted[0])
    nearness = (wanted @ np.array(taken).T).max(axis=1)
    return np.array(wanted[int(nearness.argmin())])


def attitude_of(up_b: Array) -> tuple[float, float, float, float]:
    """Return a quaternion (w, x, y, z), body to world, whose world z in body axes is `up_b` (3,).

    Only roll and pitch are used: any heading will do.
    """
    roll = math.atan2(up_b[1], up_b[2])
    pitch = math.atan2(-up_b[0], math.hypot(up_b[1], up_b[2]))
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    return cr * cp, sr * cp, cr * sp, -sr * sp


def words_of(up_b: Array) -> str:
    """Return an attitude in words: 'nose up by 35 deg, left side up by 60 deg'."""
    pitch = math.asin(max(-1.0, min(1.0, float(up_b[0]))))
    roll = math.asin(max(-1.0, min(1.0, float(up_b[1]))))
    text = [
        f"{high if angle > 0.0 else low} by {math.degrees(abs(angle)):.0f}°"
        for angle, high, low in (
            (pitch, "nose up", "nose down"),
            (roll, "left side up", "right side up"),
        )
        if abs(angle) > SMALL
    ]
    below = ", upside down" if up_b[2] < -0.1 else ""
    return (", ".join(text) or "level") + below


def face_up(name: str) -> Array:
    """Return world z in body axes of a vehicle on this face."""
    return np.array(FACES[name])
