"""Geometric tracking law as a plugin: PID on position and attitude, with feed-forward.

`quadlab new law NAME` copies it to the folder `plugins`; choose it with `--set control.law=NAME`.
Each answer is flown one tick later. The errors are those of Lee, Leok, McClamroch 2010.
"""

import numpy as np

from quadrotor.rotations import quaternion_to_matrix
from vehicle.laws.contract import Array, Input

GRAVITY_W = np.array([0.0, 0.0, 9.81])
KP, KV = np.array([4.0, 4.0, 8.0]), np.array([3.5, 3.5, 5.0])  # 1/s^2, 1/s
KI, KF = np.array([1.0, 1.0, 2.0]), np.array([10.0, 10.0, 2.0])  # 1/s^3
KR, KW = np.array([60.0, 60.0, 12.0]), np.array([12.0, 12.0, 5.0])  # 1/s^2, 1/s


class GeometricPid:
    """Control law; the vehicle makes one, and calls `reset` at a start and `step` in each tick."""

    integral_w, integral_b = np.zeros(3), np.zeros(3)
    omega_d: Array | None = None

    def reset(self) -> None:
        """Set the integrals to zero at the beginning of a flight."""
        self.integral_w, self.integral_b, self.omega_d = np.zeros(3), np.zeros(3), None

    def step(self, x: Input) -> tuple[float, Array]:
        """Return thrust (N) and torque (3,) (N m, body axes)."""
        R, omega, J = quaternion_to_matrix(x.quaternion_wb), x.angular_velocity_b, x.inertia_b
        e_p, e_v = x.reference_position_w - x.position_w, x.reference_velocity_w - x.velocity_w
        nominal = x.reference_acceleration_w + GRAVITY_W
        wanted = nominal + KP * e_p + KV * e_v + KI * self.integral_w
        D, _ = attitude(wanted, np.zeros(3), x.reference_yaw, 0.0)
        N, omega_d = attitude(nominal, x.reference_jerk_w, x.reference_yaw, x.reference_yaw_rate)
        E = R.T @ D - D.T @ R
        e_R = 0.5 * np.array([E[2, 1], E[0, 2], E[1, 0]])
        if x.flying:
            self.integral_w = np.clip(self.integral_w + e_p * x.dt, -1.0, 1.0)  # m s
            self.integral_b = np.clip(self.integral_b + e_R * x.dt, -0.3, 0.3)  # rad s
        # The reference has no noise, so its angular acceleration can be a difference.
        before = omega_d if self.omega_d is None else self.omega_d
        acceleration_d, self.omega_d = (omega_d - before) / x.dt, omega_d
        T = R.T @ N
        forward = T @ acceleration_d - np.cross(omega, T @ omega_d)
        back = KR * e_R + KW * (T @ omega_d - omega) + KF * self.integral_b
        return x.mass * float(wanted @ R[:, 2]), J * (back + forward) + np.cross(omega, J * omega)


def attitude(force: Array, rate: Array, yaw: float, yaw_rate: float) -> tuple[Array, Array]:
    """Return axes (3, 3) with z along a force (m/s²), and their angular velocity (3,), rad/s."""
    size = float(np.linalg.norm(force))
    z, y = force / size, np.cross(force, [np.cos(yaw), np.sin(yaw), 0.0])
    y, tip = y / np.linalg.norm(y), (rate - (z @ rate) * z) / size
    x = np.cross(y, z)
    return np.stack([x, y, z], axis=1), np.array([-(y @ tip), x @ tip, yaw_rate * z[2]])


law = GeometricPid  # the name that the vehicle imports
PROTOCOL = 1  # of what it imports: docs/extending/plugins.md
