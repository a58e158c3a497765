"""Geometric tracking law as a plugin: PID on position and attitude, with feed-forward.

Copy it to the folder `plugins` of the data folder (`quadlab new law NAME` does that), then choose
it with `--set control.law=geometric_pid` or on the Gains tab. It runs in a separate process; each
answer is flown one tick later. The errors are those of Lee, Leok, McClamroch 2010.
"""

from __future__ import annotations

import numpy as np

from vehicle.laws.contract import Array, Input

GRAVITY_W = np.array([0.0, 0.0, 9.81])
KP, KV = np.array([4.0, 4.0, 8.0]), np.array([3.5, 3.5, 5.0])  # 1/s^2, 1/s
KI = np.array([1.0, 1.0, 2.0])  # 1/s^3
KR, KW = np.array([60.0, 60.0, 12.0]), np.array([12.0, 12.0, 5.0])  # 1/s^2, 1/s
KF = np.array([10.0, 10.0, 2.0])  # 1/s^3


class GeometricPid:
    """Control law; the vehicle makes one instance and calls `step` in each tick."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Set the integrals to zero at the beginning of a flight."""
        self._integral_w, self._integral_b = np.zeros(3), np.zeros(3)
        self._omega_d: Array | None = None

    def step(self, x: Input) -> tuple[float, Array]:
        """Return thrust (N) and torque (3,) (N m, body axes)."""
        R = rotation(x.quaternion_wb)
        e_p = x.reference_position_w - x.position_w
        e_v = x.reference_velocity_w - x.velocity_w
        nominal = x.reference_acceleration_w + GRAVITY_W
        wanted = nominal + KP * e_p + KV * e_v + KI * self._integral_w
        D, _ = attitude(wanted, np.zeros(3), x.reference_yaw, 0.0)
        N, omega_d = attitude(nominal, x.reference_jerk_w, x.reference_yaw, x.reference_yaw_rate)
        E = R.T @ D - D.T @ R
        e_R = 0.5 * np.array([E[2, 1], E[0, 2], E[1, 0]])
        if x.flying:
            self._integral_w = np.clip(self._integral_w + e_p * x.dt, -1.0, 1.0)  # m s
            self._integral_b = np.clip(self._integral_b + e_R * x.dt, -0.3, 0.3)  # rad s

        # The reference has no noise, so its angular acceleration can be a difference.
        before = omega_d if self._omega_d is None else self._omega_d
        acceleration_d, self._omega_d = (omega_d - before) / x.dt, omega_d
        T, omega = R.T @ N, x.angular_velocity_b
        forward = T @ acceleration_d - np.cross(omega, T @ omega_d)
        back = KR * e_R + KW * (T @ omega_d - omega) + KF * self._integral_b
        J = x.inertia_b
        return x.mass * float(wanted @ R[:, 2]), J * (back + forward) + np.cross(omega, J * omega)


def rotation(quaternion: Array) -> Array:
    """Return the rotation matrix (3, 3) of a unit quaternion (w, x, y, z)."""
    w, v = quaternion[0], quaternion[1:]
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    R: Array = (w * w - v @ v) * np.eye(3) + 2.0 * (np.outer(v, v) + w * cross)
    return R


def attitude(force: Array, rate: Array, yaw: float, yaw_rate: float) -> tuple[Array, Array]:
    """Return the attitude (3, 3) whose z axis is along a force, and its angular velocity (3,).

    The angular velocity is in rad/s, in the attitude's own axes.

    Args:
        force: m/s², per unit mass. rate: m/s³, its derivative. yaw: rad. yaw_rate: rad/s.
    """
    size = float(np.linalg.norm(force))
    z = force / size
    heading = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    y = np.cross(z, heading)
    y /= np.linalg.norm(y)
    x = np.cross(y, z)
    tip = (rate - (z @ rate) * z) / size
    return np.stack([x, y, z], axis=1), np.array([-(y @ tip), x @ tip, yaw_rate * z[2]])


law = GeometricPid  # the name that the vehicle imports
PROTOCOL = 1  # of what it imports: docs/extending/plugins.md
