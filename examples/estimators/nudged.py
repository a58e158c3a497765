"""A short estimator as a plugin: dead reckoning by the IMU, nudged towards each pose.

Copy it to a folder of plugins, then fly it: `quadlab fly figure_eight --plugins plugins --set
estimation.estimator=nudged`. Its two gains are on the Gains tab, as `plugins.nudged.…`. It knows no
bias of the accelerometer, so its gains have to be stiff.
"""

from __future__ import annotations

import numpy as np

from quadrotor.parameters import Parameters, parameter
from quadrotor.rotations import quaternion_exp, quaternion_multiply, quaternion_normalize, rotate
from vehicle.estimators.contract import Array, Input

GRAVITY_W = np.array([0.0, 0.0, -9.81])
TURN = 0.05
"""Share of the attitude's difference that is taken from each pose."""


class Options(Parameters):
    position_gain: float = parameter(0.2, unit="", ge=0.0, le=1.0, step=0.01)
    """share of the position's difference that is taken from each pose"""
    velocity_gain: float = parameter(1.5, unit="1/s", ge=0.0, le=10.0, step=0.1)
    """from the position's difference to the velocity, at each pose"""


class Nudged:
    """Made once by the vehicle, which calls `reset` at the start and `step` in each tick."""

    def __init__(self) -> None:
        self.parameters = Options()

    def reset(self, x: Input) -> None:
        """Begin at the start state."""
        self.p, self.v, self.q = x.start_position_w, x.start_velocity_w, x.start_quaternion_wb

    def step(self, x: Input) -> tuple[Array, Array, Array]:
        """Return position, velocity and attitude at `x.time`."""
        self.q = quaternion_multiply(self.q, quaternion_exp(x.angular_velocity_b * x.dt))
        self.p = self.p + self.v * x.dt
        self.v = self.v + (rotate(self.q, x.specific_force_b) + GRAVITY_W) * x.dt
        if x.pose_count:
            then = self.p - self.v * (x.time - x.pose_time)  # a pose is late
            away, side = x.pose_position_w - then, np.sign(self.q @ x.pose_quaternion_wb)
            self.p = self.p + self.parameters.position_gain * away
            self.v = self.v + self.parameters.velocity_gain * away
            self.q = self.q + TURN * (side * x.pose_quaternion_wb - self.q)  # q and -q are one
        self.q = quaternion_normalize(self.q)
        return self.p, self.v, self.q


estimator = Nudged
"""The name that the vehicle imports from this file."""
