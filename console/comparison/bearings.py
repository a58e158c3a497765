"""Frames of bearings for the estimators, and how far they are from what an estimate expects."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bearing_sim.beacons import Beacons
from bearing_sim.emulator import BearingMeasurement
from console.comparison.statistics import POSITION, QUATERNION, RATE, VELOCITY
from quadrotor.records import BEARINGS_SAMPLE, MAX_BEACONS, Record

Array = npt.NDArray[np.float64]


class Frame(NamedTuple):
    """The bearings to known beacons: ids (n,), places (n, 3) m, bearings (n, 3) unit, body axes."""

    stamp_ns: int
    beacon_ids: list[int]
    places_w: Array
    bearings_b: Array
    sigma: float

    @classmethod
    def of(cls, measurement: BearingMeasurement, beacons: Beacons) -> Frame:
        """Return the frame; ids without a known place are left out."""
        places = dict(zip(beacons.ids.tolist(), beacons.positions_w, strict=True))
        ids = measurement.beacon_ids.tolist()
        known = [k for k, id in enumerate(ids) if id in places][:MAX_BEACONS]
        return cls(
            measurement.stamp_ns,
            [ids[k] for k in known],
            np.array([places[ids[k]] for k in known]).reshape(-1, 3),
            measurement.bearings_b[known],
            measurement.sigma,
        )

    def record(self) -> Record:
        """Return BEARINGS_SAMPLE (1,), what estimators take."""
        out, count = np.zeros(1, BEARINGS_SAMPLE), len(self.beacon_ids)
        item = out[0]
        item["stamp_ns"], item["count"], item["sigma"] = self.stamp_ns, count, self.sigma
        item["beacon_w"][:count], item["bearing_b"][:count] = self.places_w, self.bearings_b
        return out


def residuals(frame: Frame, states: Array, since: float) -> Array:
    """Return angles (E, n), rad, between measured bearings and those that states (E, 13) expect.

    Args:
        since: s from the states to the frame; they are carried on with their velocities.
    """
    position_w = states[:, POSITION] + since * states[:, VELOCITY]
    R = _matrices(_turned(states[:, QUATERNION], since * states[:, RATE]))
    ray_w = frame.places_w - position_w[:, None]
    ray_b = np.einsum("eij,eni->enj", R, ray_w)
    sine = np.linalg.norm(np.cross(ray_b, frame.bearings_b), axis=2)
    angles: Array = np.arctan2(sine, (ray_b * frame.bearings_b).sum(axis=2))
    return angles


def _turned(q: Array, rotation_vector_b: Array) -> Array:
    """Return q exp(rotation vector) of each row, for angles well below 1 rad, to second order."""
    w, v = q[:, :1], q[:, 1:]
    half = 0.5 * rotation_vector_b
    scalar = 1.0 - 0.5 * (half**2).sum(axis=1, keepdims=True)
    out = np.concatenate(
        (
            w * scalar - (v * half).sum(axis=1, keepdims=True),
            w * half + scalar * v + np.cross(v, half),
        ),
        axis=1,
    )
    turned: Array = out / np.linalg.norm(out, axis=1, keepdims=True)
    return turned


def _matrices(q: Array) -> Array:
    """Return R_wb (E, 3, 3) of unit quaternions (E, 4)."""
    w, x, y, z = q.T
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)
