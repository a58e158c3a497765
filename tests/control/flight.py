"""Closed loop for the tests: rigid body, motor lag, ground; the controller at its own rate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from control.controller import GeometricController
from control.parameters import ControlParameters
from quadrotor.records import ACTUATORS, Record, new_reference, new_state
from quadrotor.rotations import wrap_angle, yaw_of
from quadrotor.vehicle_model import VehicleModel
from tests.support.dynamics import motor_step, rk4_step, rotor_wrench

SUBSTEP = 0.001


@dataclass
class Flight:
    """Vehicle whose true state is known; `advance` is one tick."""

    parameters: ControlParameters = field(default_factory=ControlParameters)
    believed: VehicleModel = field(default_factory=VehicleModel)
    true_mass: float = 1.308
    force_w: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ground: bool = False
    motors_ready: bool = True

    def __post_init__(self) -> None:
        self.state = new_state()
        self.x = self.state.view("f8")
        self.reference = new_reference()
        self.actuators = np.zeros(1, ACTUATORS)
        self.controller = GeometricController()
        model = self.believed.record()
        self.controller.configure(self.parameters, model)
        self.inertia = model["inertia_b"][0].copy()
        hover = np.sqrt(self.true_mass * 9.81 / 4.0) / self.believed.motor_slope
        speed = hover - self.believed.motor_offset if self.motors_ready else 0.0
        self.speeds = np.full(4, speed)
        self.errors: list[np.ndarray] = []
        self.yaw_errors: list[float] = []
        self.scalings: list[float] = []

    def advance(self, dt: float = 0.002, airborne: bool = True, idle: bool = False) -> None:
        """Run the controller on self.reference, then the plant over dt."""
        # Before the plant moves: state and reference are of the same instant.
        self.errors.append(self.reference["position_w"][0] - self.x[:3])
        self.yaw_errors.append(wrap_angle(float(self.reference["yaw"][0]) - yaw_of(self.x[6:10])))
        if idle:
            self.controller.idle(self.actuators)
        else:
            self.controller.step(self.state, self.reference, airborne, dt, self.actuators)
        m, references = self.believed, self.actuators["motor_references"][0]
        force = np.array(self.force_w)
        steps = max(1, round(dt / SUBSTEP))
        for _ in range(steps):
            motor_step(self.speeds, references, m.motor_time_constant, dt / steps)
            wrench = rotor_wrench(self.speeds, m.motor_slope, m.motor_offset, m.arm, m.torque_ratio)
            contact = force
            if self.ground and self.x[2] < 0.0:
                contact = force + np.array(
                    [
                        -20.0 * self.x[3],
                        -20.0 * self.x[4],
                        max(0.0, -3000.0 * self.x[2] - 80.0 * self.x[5]),
                    ]
                )
            rk4_step(self.x, wrench, contact, self.true_mass, self.inertia, dt / steps)
        self.scalings.append(float(self.actuators["scaling"][0]))

    def fly(self, trajectory: object, seconds: float, dt: float = 0.002) -> np.ndarray:
        """Follow a trajectory from its start; return its position errors (N, 3), m."""
        first = len(self.errors)
        sample: Callable[[float, Record], None] = trajectory.sample  # type: ignore[attr-defined]
        for k in range(round(seconds / dt)):
            sample(k * dt, self.reference)
            self.advance(dt)
        return np.array(self.errors[first:])
