"""A gyroscope axis that is stuck is noticed, and stood in for by the motors' torques."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.tracker_integrity.felt import note_sample
from estimation.tracker_integrity.memory import new_integrity
from estimation.tracker_integrity.stuck_axis import STUCK_RATE, follow_tracker, note_turn
from quadrotor.records import ACTUATORS, IMU_SAMPLE, Array
from quadrotor.vehicle_model import GRAVITY, VehicleModel

PERIOD_NS = 2_000_000
POSES_EVERY = 5
"""Samples for each pose."""
DISTURBANCE = 1.5
"""Angular acceleration, in rad/s², that is not commanded."""


class Turning:
    """A vehicle in the air whose motors turn it about x, and its gyroscope with seeded noise."""

    def __init__(self, lift: float = 1.0, pose_noise: float = 0.15) -> None:
        model = VehicleModel()
        self._pose_noise = math.radians(pose_noise)
        self.memory, self.model = new_integrity(), model.record()
        self.time, self.rate, self.calm = 0.0, 0.0, False
        self._turned = self._shown = 0.0
        self._lift, self._inertia = lift * model.mass * GRAVITY, model.inertia_xx
        self._lag, self._push = model.motor_time_constant, 0.0
        self._chance = np.random.default_rng(1)

    def run(
        self, seconds: float, reading: float | None = None, wrong: float = 0.0
    ) -> tuple[Array, Array]:
        """Advance; return the rates (rad/s) about x that were taken for measured, and the true
        ones.

        Args:
            reading: of the axis x, where it is stuck.
            wrong: angular acceleration, in rad/s², of a commanded torque that does not act.
        """
        found = []
        dt = 1e-9 * PERIOD_NS
        for _ in range(round(seconds / dt)):
            self.time += dt
            wanted = 0.0 if self.calm else 4.0 * math.cos(6.0 * self.time)
            wanted -= DISTURBANCE
            self._push += dt / self._lag * (wanted - self._push)
            self.rate += dt * (self._push + DISTURBANCE)
            imu, actuators = np.zeros(1, IMU_SAMPLE), np.zeros(1, ACTUATORS)
            noise = math.radians(0.3) * self._chance.standard_normal(3)
            imu["stamp_ns"] = 1_000_000_000 + round(1e9 * self.time)
            imu["specific_force_b"][0, 2] = GRAVITY
            imu["angular_velocity_b"][0] = noise
            imu["angular_velocity_b"][0, 0] += self.rate
            if reading is not None:
                imu["angular_velocity_b"][0, 0] = reading
            actuators["wrench"][0, :2] = self._lift, self._inertia * (wanted + wrong)
            self._turned += dt * self.rate
            if round(self.time / dt) % POSES_EVERY == 0:
                turn = self._turned + self._pose_noise * self._chance.standard_normal()
                since = POSES_EVERY * dt
                turned_b = (turn - self._shown, 0.0, 0.0)
                note_turn(self.memory[0], turned_b, since)
                follow_tracker(self.memory[0], turned_b, since)
                self._shown = turn
            note_sample(self.memory, imu, actuators, self.model, 1e5)
            found.append((imu["angular_velocity_b"][0, 0], self.rate))
        taken, true = np.array(found).T
        return taken, true

    def is_stuck(self) -> bool:
        return bool(self.memory["stuck"].any())


def test_a_stuck_axis_has_the_rate_that_the_motors_give() -> None:
    vehicle = Turning()
    vehicle.run(3.0)
    assert not vehicle.is_stuck()
    taken, true = vehicle.run(1.0, reading=vehicle.rate)
    assert vehicle.is_stuck()
    assert abs(taken - true).max() < math.radians(20.0)  # until the tracker shows it too
    assert abs(taken - true)[100:].max() < math.radians(4.0)
    assert np.ptp(true) > math.radians(60.0)


def test_an_axis_that_measures_again_is_used_again() -> None:
    vehicle = Turning()
    vehicle.run(3.0)
    vehicle.run(0.5, reading=vehicle.rate)
    taken, true = vehicle.run(0.5)
    assert not vehicle.is_stuck()
    assert abs(taken - true).max() < math.radians(1.5)  # the gyroscope's own noise


@pytest.mark.parametrize("lift", [0.0, 0.3])
def test_on_the_ground_no_axis_is_stuck(lift: float) -> None:
    vehicle = Turning(lift)
    taken, _ = vehicle.run(3.0, reading=0.25)
    assert not vehicle.is_stuck()
    assert (taken == 0.25).all()


def test_a_calm_reading_that_stays_the_same_is_not_stuck_where_the_torques_are_wrong() -> None:
    """A reading in whole counts does so, while the observer's errors add up."""
    vehicle = Turning()
    vehicle.calm = True
    vehicle.run(2.0)
    vehicle.run(1.0, reading=vehicle.rate, wrong=6.0)
    observed = vehicle.memory["rate_b"][0, 0]
    assert abs(observed - vehicle.rate) > STUCK_RATE, "the observer alone would be wrong"
    assert not vehicle.is_stuck()


def test_a_steady_turn_is_not_stuck_where_poses_are_noisy() -> None:
    """The observer follows the poses while a reading in whole counts stays the same."""
    vehicle = Turning(pose_noise=0.4)
    vehicle.calm, vehicle.rate = True, math.radians(28.0)
    vehicle.run(2.0)
    for _ in range(200):  # the reading stays for 0.05 s, and changes by less than noise
        vehicle.run(0.05, reading=vehicle.rate)
        assert not vehicle.is_stuck()
        vehicle.run(0.01)
