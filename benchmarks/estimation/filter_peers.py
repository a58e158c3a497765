"""Peers of the filters: ahrs (attitude from gyroscope and accelerometer), filterpy (position)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from benchmarks.estimation.flights import BEACONS, FORCE_NOISE, RATE, SIGMA, UP, Flight, quaternion
from benchmarks.harness import Row
from estimation.poses.planar_pose import planar_pose
from quadrotor.records import Array


def peers(
    flights: list[Flight], discarded: float, ours: Callable[[], Any], fly: Callable[..., Any]
) -> tuple[list[Row], list[str]]:
    """Return rows and notes; a peer that is not installed gives a note."""
    rows, notes = [], []
    try:
        rows += list(_ahrs(flights, discarded))
        notes.append(
            "ahrs gets gyroscope and accelerometer alone and the true attitude at the start: no "
            "filter of it takes bearings, so its tilt is compared and its yaw left out"
        )
    except ImportError:
        notes.append("ahrs is not installed: its attitude filters are left out")
    try:
        rows.append(_filterpy(flights, discarded, ours, fly))
        notes.append(
            "filterpy's Kalman filter (6 states) gets one-frame positions weighed by their own "
            "covariance, and the acceleration turned by our complementary filter's attitude, "
            "which is not in its time; nor are the one-frame poses"
        )
    except ImportError:
        notes.append("filterpy is not installed: its Kalman filter is left out")
    return rows, notes


def _ahrs(flights: list[Flight], discarded: float) -> Iterator[Row]:
    from ahrs.filters import EKF, Madgwick, Mahony

    # Its EKF expects an accelerometer at rest to show the direction that "NED" calls down.
    makes: dict[str, Callable[[], tuple[Any, str]]] = {
        "ahrs Mahony (tilt)": lambda: (Mahony(frequency=RATE), "updateIMU"),
        "ahrs Madgwick (tilt)": lambda: (Madgwick(frequency=RATE), "updateIMU"),
        "ahrs EKF (tilt)": lambda: (EKF(frequency=RATE, frame="NED"), "update"),
    }
    for name, make in makes.items():
        errors, seconds = [], []
        for flight in flights:
            one, method = make()
            step = getattr(one, method)
            q = quaternion(flight.R_wb[0])
            up = np.empty((len(flight.t), 3))
            began = time.perf_counter()
            for k, sample in enumerate(flight.sample):
                q = step(q, sample[:3], sample[3:])
                w, x, y, z = q
                up[k] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
            seconds.append((time.perf_counter() - began) / flight.t[-1])
            share = np.clip((up * flight.R_wb[:, 2]).sum(axis=1), -1.0, 1.0)
            errors.append((np.arccos(share)[flight.t > discarded] ** 2).mean())
        yield Row(
            name,
            {
                "deg": float(np.degrees(np.sqrt(np.mean(errors)))),
                "µs a second": 1e6 * float(np.median(seconds)),
            },
        )


def _filterpy(
    flights: list[Flight], discarded: float, ours: Callable[[], Any], fly: Callable[..., Any]
) -> Row:
    from filterpy.kalman import KalmanFilter

    dt = 1.0 / RATE
    errors, seconds = [], []
    for flight in flights:
        attitude = fly(flight, ours()).states["quaternion_wb"]
        accelerations = _turned(attitude, flight.sample[:, 3:]) - UP
        poses = _poses(flight)
        kalman = KalmanFilter(dim_x=6, dim_z=3, dim_u=3)
        kalman.F = np.eye(6) + dt * np.eye(6, k=3)
        kalman.B = np.vstack([0.5 * dt * dt * np.eye(3), dt * np.eye(3)])
        kalman.H = np.eye(3, 6)
        # White noise of the accelerometer and 0.3 deg of tilt, treated as white over 1 s.
        kalman.Q = np.diag([1e-12] * 3 + [(dt * FORCE_NOISE) ** 2 + dt * 0.05**2] * 3)
        kalman.x[:3, 0] = flight.position_w[0]
        kalman.P = np.diag([0.02] * 3 + [0.5] * 3)
        states, began, next_pose = np.empty((len(flight.t), 6)), time.perf_counter(), 0
        for k, t in enumerate(flight.t):
            kalman.predict(u=accelerations[k, :, None])
            states[k] = kalman.x[:, 0]
            while next_pose < len(poses) and poses[next_pose][0] <= t:
                kalman.update(poses[next_pose][1][:, None], R=poses[next_pose][2])
                next_pose += 1
        seconds.append((time.perf_counter() - began) / flight.t[-1])
        used = flight.t > discarded
        error = states - np.hstack([flight.position_w, flight.velocity_w])
        errors.append((error[used] ** 2).reshape(-1, 2, 3).sum(axis=2).mean(axis=0))
    position, velocity = np.sqrt(np.mean(errors, axis=0)).tolist()
    return Row(
        "filterpy KalmanFilter (translation)",
        {"m": position, "m/s": velocity, "µs a second": 1e6 * float(np.median(seconds))},
    )


def _poses(flight: Flight) -> list[tuple[float, Array, Array]]:
    """Return time, position (3,) and covariance (3, 3) of each frame alone, started at truth."""
    out = []
    for frame in flight.frames:
        start = (frame.position_w, quaternion(frame.R_wb))
        pose = planar_pose(BEACONS, frame.bearings_b, SIGMA, start)
        out.append((frame.t, pose.position_w, pose.covariance[:3, :3]))
    return out


def _turned(q: Array, v: Array) -> Array:
    """Return R(q) v for each row of q (n, 4) and v (n, 3)."""
    w, u = q[:, :1], q[:, 1:]
    t = 2.0 * np.cross(u, v)
    out: Array = v + w * t + np.cross(u, t)
    return out
