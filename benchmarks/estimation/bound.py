"""Posterior Cramér-Rao bound of a flight: the information recursion at the true trajectory.

Written independently of the filter, with dense matrices and the error order (position, velocity,
attitude in world axes, gyroscope bias, accelerometer bias).
"""

from __future__ import annotations

import numpy as np

from benchmarks.estimation.flights import (
    BEACONS,
    FORCE_BIAS,
    FORCE_NOISE,
    RATE,
    RATE_BIAS,
    RATE_NOISE,
    SIGMA,
    Flight,
    Frame,
)
from quadrotor.records import Array

START = np.repeat([0.15, 0.75, np.radians(4.0), RATE_BIAS, FORCE_BIAS], 3)
"""Standard deviations before the first frame: a one-frame pose; the flights' speed and biases."""


def skew(v: Array) -> Array:
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def bound(flight: Flight) -> Array:
    """Return variance (n, 3) of position (m^2), velocity and attitude (rad^2) at each IMU instant.

    Frames of the instant itself are not included, as for an estimator that is read before they
    arrive.
    """
    P = np.diag(START**2)
    found = np.empty((len(flight.t), 3))
    frames = iter(flight.frames)
    frame = next(frames, None)
    found[0] = _blocks(P)
    for k in range(len(flight.t) - 1):
        t, end = flight.t[k], flight.t[k + 1]
        a = flight.R_wb[k] @ flight.force_b[k]
        while frame is not None and frame.t < end:
            P = _predict(P, flight.R_wb[k], a, frame.t - t)
            P = _update(P, frame)
            t, frame = frame.t, next(frames, None)
        P = _predict(P, flight.R_wb[k], a, end - t)
        found[k + 1] = _blocks(P)
    return found


def _blocks(P: Array) -> Array:
    d = np.diag(P)
    return np.array([d[:3].sum(), d[3:6].sum(), d[6:9].sum()])


def _predict(P: Array, R_wb: Array, force_w: Array, dt: float) -> Array:
    if dt <= 0.0:
        return P
    F = np.eye(15)
    F[0:3, 3:6] = dt * np.eye(3)
    F[3:6, 6:9] = -dt * skew(force_w)
    F[3:6, 12:15] = -dt * R_wb
    F[0:3, 6:15] = 0.5 * dt * F[3:6, 6:15]
    F[6:9, 9:12] = -dt * R_wb
    P = F @ P @ F.T
    P[range(3, 6), range(3, 6)] += dt * FORCE_NOISE**2 / RATE
    P[range(6, 9), range(6, 9)] += dt * RATE_NOISE**2 / RATE
    return P


def _update(P: Array, frame: Frame) -> Array:
    """Return (P^-1 + sum J^T J / sigma^2)^-1 with two tangent rows per bearing."""
    information = np.linalg.inv(P)
    for place in BEACONS:
        away = place - frame.position_w
        rho = float(np.linalg.norm(away))
        d = away / rho
        tangents = np.linalg.svd(d[None, :])[2][1:]
        J = np.zeros((2, 15))
        J[:, 0:3] = -tangents / rho
        J[:, 6:9] = tangents @ skew(d)
        information += J.T @ J / SIGMA**2
    return np.linalg.inv(information)
