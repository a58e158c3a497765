"""Residuals of measured bearings with respect to those that an estimate predicts."""

from __future__ import annotations

import numpy as np

from extensions.comparison.statistics import POSITION, QUATERNION, RATE, VELOCITY
from quadrotor.plain_rotations import matrices_of, product_of
from quadrotor.records import Array, Record


def residuals(frame: Record, states: Array, since: float) -> Array:
    """Return the angles (E, n), rad, between measured bearings and those expected from states (E,
    13).

    Args:
        frame: BEARINGS_SAMPLE (1,) of n beacons.
        since: s from the states to the frame; they are extrapolated with their velocities.
    """
    position_w = states[:, POSITION] + since * states[:, VELOCITY]
    R = matrices_of(_turned(states[:, QUATERNION], since * states[:, RATE]))
    count = frame["count"][0]
    bearings_b = frame["bearing_b"][0, :count]
    ray_w = frame["beacon_w"][0, :count] - position_w[:, None]
    ray_b = np.einsum("eij,eni->enj", R, ray_w)
    sine = np.linalg.norm(np.cross(ray_b, bearings_b), axis=2)
    angles: Array = np.arctan2(sine, (ray_b * bearings_b).sum(axis=2))
    return angles


def _turned(q: Array, rotation_vector_b: Array) -> Array:
    """Return q exp(rotation vector) of each row, for angles well below 1 rad, to second order."""
    half = 0.5 * rotation_vector_b
    scalar = 1.0 - 0.5 * (half**2).sum(axis=1, keepdims=True)
    out = product_of(q, np.hstack((scalar, half)))
    turned: Array = out / np.linalg.norm(out, axis=1, keepdims=True)
    return turned
