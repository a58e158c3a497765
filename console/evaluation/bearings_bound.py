"""The Cramér-Rao bound of a flight on bearings: the least error that an estimate could have.

The information of each recorded frame on the pose (`bearing_sim.observability`) is added up along
the flown trajectory, and carried from frame to frame with the IMU's noise and biases: the posterior
bound of an estimator with memory. Noise and random walks of the IMU are those that the vehicle's
`estimation.error_state.*` assume; the bearings' sigma is that of the frames. Sensor faults beyond
sigma (bias, swapped identities, wrong beacon positions) are not in the bound, so limits that scale
with it reveal them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from estimation.error_state_parameters import ErrorStateParameters
from estimation.parameters import EstimationParameters, noise_record
from quadrotor.constants import GRAVITY
from quadrotor.plain_rotations import matrix_of
from quadrotor.records import Array

START = np.repeat([0.1, math.radians(3.0), 0.5, 0.01, 0.1], 3)
"""Standard deviations before the first frame of position (m), attitude (rad), velocity (m/s),
gyroscope bias (rad/s) and accelerometer bias (m/s^2): about those of a pose from one frame."""
ERRORS = len(START)
NEAREST = 0.05
"""Distance in m below which the direction to a beacon is not used."""
LONGEST = 1.0
"""Longest time, in s, over which the error is propagated between frames; longer gaps count as this,
as nothing is known of the flight in them."""


class Frame(NamedTuple):
    """One frame of bearings: when it was taken (s), the ids in it, and its sigma (rad)."""

    time: float
    beacon_ids: tuple[int, ...]
    sigma: float


@dataclass(frozen=True, slots=True)
class PoseBound:
    """Least rms errors of position (m) and attitude (rad); NaN when unknown."""

    position: float
    attitude: float

    def seen_by(self, position_sigma: float, attitude_sigma: float) -> PoseBound:
        """Return the bound for errors that are measured against noisy poses.

        Args:
            position_sigma, attitude_sigma: of these poses on each axis, m and rad.
        """
        root3 = math.sqrt(3.0)
        return PoseBound(
            math.hypot(self.position, root3 * position_sigma),
            math.hypot(self.attitude, root3 * attitude_sigma),
        )


UNKNOWN = PoseBound(math.nan, math.nan)


def posterior_bound(
    frames: Sequence[Frame],
    positions_w: Array,
    quaternions_wb: Array,
    beacons: Mapping[int, Sequence[float]],
    noise: ErrorStateParameters,
    window: tuple[float, float],
) -> PoseBound:
    """Return the bound, rms over the frames within `window` (s).

    Each value is of the moment before the frame, when the estimate is oldest. The specific force is
    taken as that of hover, which ignores what manoeuvres reveal about the yaw.

    Args:
        frames: in order, from where the estimator began or later.
        positions_w, quaternions_wb: (N, 3) m and (N, 4), the pose at each frame.
        beacons: position (m, world) by id; ids without a position are ignored.
    """
    if not beacons:
        return UNKNOWN
    g: np.void = noise_record(EstimationParameters(error_state=noise))[0]
    P = np.diag(START**2)
    walks = (
        np.repeat(
            [
                0.0,
                g["gyroscope_noise"],
                g["accelerometer_noise"],
                g["gyroscope_bias_walk"],
                g["accelerometer_bias_walk"],
            ],
            3,
        )
        ** 2
    )
    found = []
    for k, frame in enumerate(frames):
        if k:
            dt = min(frame.time - frames[k - 1].time, LONGEST)
            F = _transition(matrix_of(quaternions_wb[k - 1]), dt)
            P = F @ P @ F.T
            P[range(ERRORS), range(ERRORS)] += dt * walks
        if window[0] <= frame.time <= window[1]:
            variances = np.diag(P)
            found.append((variances[:3].sum(), variances[3:6].sum()))
        H = _rows([beacons[id] for id in frame.beacon_ids if id in beacons], positions_w[k])
        sigma = max(frame.sigma, float(g["bearing_sigma_floor"]))
        S = H @ P[:6, :6] @ H.T
        S[range(len(H)), range(len(H))] += sigma * sigma
        gain = np.linalg.solve(S, H @ P[:6])
        P = P - (H @ P[:6]).T @ gain
        P = 0.5 * (P + P.T)
    if not found:
        return UNKNOWN
    position, attitude = np.sqrt(np.mean(found, axis=0)).tolist()
    return PoseBound(position, attitude)


def _transition(R_wb: Array, dt: float) -> Array:
    """Return the transition matrix (15, 15) of the error over `dt` s, at the specific force of
    hover.
    """
    force_w = np.array([[0.0, -GRAVITY, 0.0], [GRAVITY, 0.0, 0.0], [0.0, 0.0, 0.0]])  # [f] cross
    F = np.eye(ERRORS)
    F[0:3, 6:9] = dt * np.eye(3)
    F[6:9, 3:6] = -dt * force_w
    F[6:9, 12:15] = -dt * R_wb
    F[3:6, 9:12] = -dt * R_wb
    F[6:9, 9:12] = 0.5 * dt * dt * force_w @ R_wb
    F[0:3, 3:6], F[0:3, 12:15] = 0.5 * dt * F[6:9, 3:6], 0.5 * dt * F[6:9, 12:15]
    return F


def _rows(places_w: Sequence[Sequence[float]], position_w: Array) -> Array:
    """Return the derivatives (2 M, 6) of two tangent angles of each bearing with respect to
    position and attitude.
    """
    away = np.asarray(places_w, dtype=float).reshape(-1, 3) - position_w
    away = away[np.linalg.norm(away, axis=1) > NEAREST]
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    d = away / distance
    across = np.eye(3)[np.abs(d).argmin(axis=1)]
    t = np.cross(d, across)
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    u = np.cross(d, t)
    # A rotation phi moves the direction by phi x d: along t by phi . (d x t).
    rows = [np.concatenate([-one / distance, np.cross(d, one)], axis=1) for one in (t, u)]
    out: Array = np.concatenate(rows)
    return out
