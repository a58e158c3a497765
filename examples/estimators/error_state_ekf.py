"""An error-state Kalman filter as a plugin: poses, positions of a marker, and bearings.

Copy it to the folder `plugins` of the data folder (`quadlab new estimator NAME` does that), then
choose it with `--set estimation.estimator=error_state_ekf`. It runs in a process of its own; each
answer is flown one tick later. The error is that of position, velocity, attitude (about the body's
axes), gyroscope bias and accelerometer bias, three numbers each (Solà 2017, section 5).
"""

from __future__ import annotations

from collections import deque

import numpy as np

from quadrotor.rotations import (
    hat,
    quaternion_conjugate,
    quaternion_exp,
    quaternion_log,
    quaternion_multiply,
    quaternion_normalize,
    quaternion_to_matrix,
)
from vehicle.estimators.contract import Answer, Array, Input

LATE = 50
"""Ticks by which a measurement may be late."""
GRAVITY_W, ONE = np.array([0.0, 0.0, -9.81]), np.eye(3)
START = np.repeat([0.02, 0.1, 0.05, 0.01, 0.2], 3)  # m, m/s, rad, rad/s, m/s²: deviations
NOISE = np.repeat([0.0, 0.1, 0.005, 1e-3, 1e-2], 3)  # the same, per root of a second
P, V, A, G, F = (slice(3 * k, 3 * k + 3) for k in range(5))


class ErrorStateEkf:
    """Made once by the vehicle, which calls `reset` at the start and `step` in each tick."""

    def reset(self, x: Input) -> None:
        """Begin at the start state."""
        self.p, self.v, self.q = x.start_position_w, x.start_velocity_w, x.start_quaternion_wb
        self.b_g, self.b_f, self.covariance = np.zeros(3), np.zeros(3), np.diag(START**2)
        self.past: deque[tuple[float, Array, Array]] = deque(maxlen=LATE)

    def step(self, x: Input) -> Answer:
        """Return the estimate at `x.time`."""
        dt, f, omega = x.dt, x.specific_force_b - self.b_f, x.angular_velocity_b - self.b_g
        self.q = quaternion_multiply(self.q, quaternion_exp(omega * dt))
        R = quaternion_to_matrix(self.q)
        self.p = self.p + self.v * dt
        self.v = self.v + (R @ f + GRAVITY_W) * dt
        T = np.eye(15)
        T[P, V], T[V, A], T[V, F] = ONE * dt, -R @ hat(f) * dt, -R * dt
        T[A, A], T[A, G] = ONE - hat(omega) * dt, -ONE * dt
        self.covariance = T @ self.covariance @ T.T + np.diag(NOISE**2 * dt)
        self.past.append((x.time, self.p, self.q))
        if x.pose_count:
            self._pose(x)
        if x.bearing_count:
            self._bearings(x)
        variance = np.diag(self.covariance)
        attitude_w = np.diag(R @ self.covariance[A, A] @ R.T)
        q = quaternion_normalize(self.q)
        return Answer(self.p, self.v, q, self.b_g, self.b_f, variance[P], variance[V], attitude_w)

    def _pose(self, x: Input) -> None:
        p, q = self._at(x.pose_time)
        H = np.zeros((6, 15))
        H[:3, P], H[3:, A] = ONE, ONE
        r = np.append(x.pose_position_w - p, np.zeros(3))
        if x.pose_quaternion_wb.any():
            r[3:] = quaternion_log(
                quaternion_multiply(quaternion_conjugate(q), x.pose_quaternion_wb)
            )
        rows = 6 if x.pose_quaternion_wb.any() else 3
        noise = np.repeat([x.pose_position_deviation, x.pose_attitude_deviation], 3)
        self._correct(r[:rows], H[:rows], noise[:rows])

    def _bearings(self, x: Input) -> None:
        p, q = self._at(x.bearing_time)
        R, n = quaternion_to_matrix(q), int(x.bearing_count)
        H, r = np.zeros((3 * n, 15)), np.zeros(3 * n)
        for k in range(n):
            away = R.T @ (x.beacon_w[k] - p)
            distance = float(np.linalg.norm(away))
            u, row = away / distance, slice(3 * k, 3 * k + 3)
            r[row] = x.bearing_b[k] - u
            H[row, P], H[row, A] = (np.outer(u, u) - ONE) @ R.T / distance, hat(u)
        self._correct(r, H, np.full(3 * n, x.bearing_deviation))

    def _at(self, time: float) -> tuple[Array, Array]:
        """Return position and attitude at an earlier time (s)."""
        _, p, q = min(self.past, key=lambda one: abs(one[0] - time))
        return p, q

    def _correct(self, r: Array, H: Array, deviation: Array) -> None:
        """Take a residual, whose correction of the past state serves the present one too."""
        noise = np.diag(deviation**2)
        K = np.linalg.solve(H @ self.covariance @ H.T + noise, H @ self.covariance).T
        e, left = K @ r, np.eye(15) - K @ H
        # By Joseph's form, which keeps it positive.
        self.covariance = left @ self.covariance @ left.T + K @ noise @ K.T
        self.p, self.v = self.p + e[P], self.v + e[V]
        self.q = quaternion_multiply(self.q, quaternion_exp(e[A]))
        self.b_g, self.b_f = self.b_g + e[G], self.b_f + e[F]
        self.past = deque(
            ((t, p + e[P], quaternion_multiply(q, quaternion_exp(e[A]))) for t, p, q in self.past),
            maxlen=LATE,
        )


estimator = ErrorStateEkf  # the name that the vehicle imports
PROTOCOL = 1  # of what it imports: docs/extending/plugins.md
