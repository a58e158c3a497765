"""An error-state Kalman filter as a plugin: poses, positions of a marker, and bearings.

`quadlab new estimator NAME` copies it to the folder `plugins`; choose it with `--set
estimation.estimator=NAME`. Each answer is flown one tick later. The error is that of position,
velocity, attitude (about the body's axes), gyroscope bias and accelerometer bias, three numbers
each (Solà 2017, section 5).
"""

from collections import deque

import numpy as np

from quadrotor import rotations as so3
from vehicle.estimators.contract import Answer, Array, Input

LATE = 50  # ticks by which a measurement may be late
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
        self.q = so3.quaternion_multiply(self.q, so3.quaternion_exp(omega * dt))
        R, T = so3.quaternion_to_matrix(self.q), np.eye(15)
        self.p, self.v = self.p + self.v * dt, self.v + (R @ f + GRAVITY_W) * dt
        T[P, V], T[V, A], T[V, F] = ONE * dt, -R @ so3.hat(f) * dt, -R * dt
        T[A, A], T[A, G] = ONE - so3.hat(omega) * dt, -ONE * dt
        self.covariance = T @ self.covariance @ T.T + np.diag(NOISE**2 * dt)
        self.past.append((x.time, self.p, self.q))
        if x.pose_count:
            p, q = self.at(x.pose_time)
            turn = so3.quaternion_multiply(so3.quaternion_conjugate(q), x.pose_quaternion_wb)
            rows = 6 if turn.any() else 3  # a marker has no attitude
            r = np.append(x.pose_position_w - p, so3.quaternion_log(turn) if rows == 6 else ())
            H = np.eye(15)[np.r_[P, A][:rows]]
            noise = np.repeat([x.pose_position_deviation, x.pose_attitude_deviation], 3)
            self.correct(r, H, noise[:rows])
        if x.bearing_count:
            self.correct_bearings(x, *self.at(x.bearing_time))
        variance, attitude_w = np.diag(self.covariance), np.diag(R @ self.covariance[A, A] @ R.T)
        q = so3.quaternion_normalize(self.q)
        return Answer(self.p, self.v, q, self.b_g, self.b_f, variance[P], variance[V], attitude_w)

    def at(self, time: float) -> tuple[Array, Array]:
        """Return position and attitude at an earlier time (s)."""
        return min(self.past, key=lambda one: abs(one[0] - time))[1:]

    def correct_bearings(self, x: Input, p: Array, q: Array) -> None:
        """Take a frame of bearings; p and q are those at its time."""
        n, R = int(x.bearing_count), so3.quaternion_to_matrix(q)
        away = (x.beacon_w[:n] - p) @ R
        distance = np.linalg.norm(away, axis=1)[:, None]
        u, H = away / distance, np.zeros((n, 3, 15))
        H[:, :, P] = (u[:, :, None] * u[:, None] - ONE) @ R.T / distance[:, None]
        H[:, :, A] = [so3.hat(one) for one in u]
        r = (x.bearing_b[:n] - u).ravel()
        self.correct(r, H.reshape(3 * n, 15), np.full(3 * n, x.bearing_deviation))

    def correct(self, r: Array, H: Array, deviation: Array) -> None:
        """Take a residual, whose correction of the past state serves the present one too."""
        C, noise = self.covariance, np.diag(deviation**2)
        K = np.linalg.solve(H @ C @ H.T + noise, H @ C).T
        e, left = K @ r, np.eye(15) - K @ H
        self.covariance = left @ C @ left.T + K @ noise @ K.T  # Joseph's form stays positive
        self.p, self.v, turn = self.p + e[P], self.v + e[V], so3.quaternion_exp(e[A])
        self.q, self.b_g = so3.quaternion_multiply(self.q, turn), self.b_g + e[G]
        self.b_f = self.b_f + e[F]
        moved = [(t, p + e[P], so3.quaternion_multiply(q, turn)) for t, p, q in self.past]
        self.past = deque(moved, maxlen=LATE)


estimator = ErrorStateEkf  # the name that the vehicle imports
PROTOCOL = 1  # of what it imports: docs/extending/plugins.md
