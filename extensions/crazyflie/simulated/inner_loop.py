"""The inner loops of a simulated Crazyflie: estimated attitude, angles, rates, motors.

The structure, the gains and their units are those of the firmware's cascaded PID controller
(Bitcraze's documentation, "Controllers in the Crazyflie"): angles in degrees, pitch with the nose
up positive, outputs in 1/65535 of a motor's thrust. The mixer is that of rotors on the body's axes
with the same torques.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from extensions.crazyflie.board.messages import THRUST_FULL
from quadrotor.rotations import (
    euler_from_quaternion,
    quaternion_conjugate,
    quaternion_exp,
    quaternion_log,
    quaternion_multiply,
    quaternion_normalize,
    rotate_inverse,
)
from quadrotor.vehicle_model import Four

RATE_STEP_S = 0.002
ACCELERATION_GAIN, POSE_GAIN = 0.02, 0.2
"""Share of an error of attitude that gravity takes off a second, and each pose at once."""
INTEGRAL_MAX = {"rate": (33.3, 33.3, 166.7), "attitude": (20.0, 20.0, 360.0)}
AXES = ("roll", "pitch", "yaw")
Three = Sequence[float]


class Estimate:
    """Its estimate: the attitude by its gyroscope, gravity and poses, the position by poses alone.

    Attributes:
        position_w: m, of the newest pose.
        quaternion_wb: (4,).
    """

    def __init__(self) -> None:
        self.position_w = (0.0, 0.0, 0.0)
        self.quaternion_wb = np.array((1.0, 0.0, 0.0, 0.0))
        self._has_pose = False

    @property
    def degrees(self) -> tuple[float, float, float]:
        """Return roll, pitch (nose up positive) and yaw."""
        roll, pitch, yaw = np.degrees(euler_from_quaternion(self.quaternion_wb)).tolist()
        return roll, -pitch, yaw

    def predict(self, omega_b: Three, force_b: Three) -> None:
        """Turn by the rates (rad/s) of one step, and towards gravity without poses."""
        turn = RATE_STEP_S * np.array(omega_b)
        if not self._has_pose:
            up_b = rotate_inverse(self.quaternion_wb, np.array((0.0, 0.0, 1.0)))
            pull = np.cross(np.array(force_b) / max(1.0, math.hypot(*force_b)), up_b)
            turn += RATE_STEP_S * ACCELERATION_GAIN * pull
        self._turn(turn)

    def correct(self, position_w: Three, quaternion_wb: Three) -> None:
        """Correct by a pose."""
        measured = quaternion_normalize(np.array(quaternion_wb))
        error = quaternion_multiply(quaternion_conjugate(self.quaternion_wb), measured)
        self._turn((POSE_GAIN if self._has_pose else 1.0) * quaternion_log(error))
        self._has_pose = True
        x, y, z = position_w
        self.position_w = x, y, z

    def _turn(self, phi: npt.NDArray[np.float64]) -> None:
        turned = quaternion_multiply(self.quaternion_wb, quaternion_exp(phi))
        self.quaternion_wb = quaternion_normalize(turned)


class _Pid:
    """One loop; its derivative is that of the measured value."""

    def __init__(self, prefix: str, integral_max: float) -> None:
        self._names = tuple(f"{prefix}_{gain}" for gain in ("kp", "ki", "kd"))
        self._integral_max = integral_max
        self._integral = 0.0
        self._last: float | None = None

    def reset(self) -> None:
        self._integral, self._last = 0.0, None

    def step(self, gains: Mapping[str, float], error: float, measured: float) -> float:
        kp, ki, kd = (gains[name] for name in self._names)
        slope = 0.0 if self._last is None else _wrapped(measured - self._last) / RATE_STEP_S
        self._last = measured
        m = self._integral_max
        self._integral = min(m, max(-m, self._integral + RATE_STEP_S * error))
        return kp * error + ki * self._integral - kd * slope


class InnerLoop:
    """The cascade from angles or rates to motors, at 500 Hz."""

    def __init__(self) -> None:
        self._rate, self._angle = (
            [
                _Pid(f"pid_{loop}.{axis}", most)
                for axis, most in zip(AXES, INTEGRAL_MAX[loop], strict=True)
            ]
            for loop in ("rate", "attitude")
        )
        self._yaw = 0.0
        self._was_rate: bool | None = None

    def reset(self, yaw: float) -> None:
        """Forget everything, with the motors off; `yaw` in degrees."""
        for loop in (*self._rate, *self._angle):
            loop.reset()
        self._yaw = yaw

    def step(
        self,
        gains: Mapping[str, float],
        wanted: Three,
        is_rate: bool,
        thrust: float,
        omega_b: Three,
        degrees: Three,
    ) -> Four:
        """Return the motors' shares of their full thrust, 0..1, front, left, rear, right.

        Args:
            wanted: roll and pitch, deg or deg/s, and yaw rate, deg/s.
            thrust: counts.
            omega_b: rad/s.
            degrees: estimated roll, pitch, yaw.
        """
        if thrust <= 0.0 or is_rate is not self._was_rate:
            self.reset(degrees[2])
            self._was_rate = is_rate
        if thrust <= 0.0:
            return 0.0, 0.0, 0.0, 0.0
        self._yaw = _wrapped(self._yaw + RATE_STEP_S * wanted[2])
        angles = (*wanted[:2], self._yaw)
        rates = [
            loop.step(gains, _wrapped(angle - is_now), is_now)
            for loop, angle, is_now in zip(self._angle, angles, degrees, strict=True)
        ]
        if is_rate:
            rates[:2] = wanted[:2]
        p, q, r = (math.degrees(omega) for omega in omega_b)
        roll, pitch, yaw = (
            loop.step(gains, rate - is_now, is_now)
            for loop, rate, is_now in zip(self._rate, rates, (p, -q, r), strict=True)
        )
        # Four rotors on the diagonals turn with half an output each; two on the axes need this.
        roll, pitch = roll / math.sqrt(2.0), pitch / math.sqrt(2.0)
        motors = (
            thrust + pitch + yaw,
            thrust + roll - yaw,
            thrust - pitch + yaw,
            thrust - roll - yaw,
        )
        over = max(0.0, max(motors) - THRUST_FULL)
        front, left, rear, right = (max(0.0, motor - over) / THRUST_FULL for motor in motors)
        return front, left, rear, right


def _wrapped(degrees: float) -> float:
    return (degrees + 180.0) % 360.0 - 180.0
