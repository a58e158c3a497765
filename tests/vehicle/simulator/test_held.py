"""The simulated vehicle in a hand and on the bench, its true T, and the force/torque sensor."""

from __future__ import annotations

import math

import numpy as np
import pytest

from quadrotor.motor_state import MotorState
from quadrotor.rotations import quaternion_from_euler, quaternion_log, quaternion_multiply
from quadrotor.vehicle_model import thrust_of_reference
from tests.support.arrays import Array
from tests.support.narrowing import now
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.simulator.force_sensor import FORCE_STEP, TORQUE_STEP, ForceReading
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle_link.serial.ids import Id

COUNT = 0.0039 * 9.81
STEP = 0.002


class Robot:
    """Simulated vehicle that is stepped and configured; motors as commanded."""

    def __init__(self, **parameters: object) -> None:
        self.parameters = SimulatorParameters.model_validate(parameters)
        self.simulated = SimulatedVehicle(self.parameters)
        self._mcu = Microcontroller(self.simulated.ports, 0)
        self.references = (0, 0, 0, 0)
        self.readings: list[ForceReading] = []

    def configure(self, **parameters: object) -> None:
        self.parameters = self.parameters.model_copy(update=parameters)
        self.simulated.configure(self.parameters)

    def turn_on(self, references: tuple[int, int, int, int]) -> None:
        self._mcu.set_motor_state(MotorState.ON)
        self.references = references

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP)):
            self.simulated.step()
            self._mcu.receive()
            self._mcu.command(self.references)
            self._mcu.service(self.simulated.stamp_ns * 1e-9)
            reading = self.simulated.bench_reading()
            if reading is not None:
                self.readings.append(reading)

    @property
    def attitude(self) -> Array:
        return np.array(self.simulated.truth["quaternion_wb"][0])

    @property
    def height(self) -> float:
        return float(self.simulated.truth["position_w"][0, 2])

    def measured(self, seconds: float = 0.5) -> np.ndarray:
        """Return the mean accelerometer (3,), m/s^2, as the converters report it."""
        sums = np.zeros(3)
        for _ in range(round(seconds / STEP)):
            self.run(STEP)
            sums += self.simulated.firmware.registers[: Id.GYROSCOPE_X][:3] - 512.0
        return COUNT * sums / round(seconds / STEP)


def test_a_hand_turns_it_at_its_rate_lifts_it_and_stands_still() -> None:
    robot = Robot()
    robot.run(0.1)
    robot.configure(held="hand", hand_roll=170.0, hand_pitch=-40.0, hand_yaw=30.0)
    wanted = quaternion_from_euler(*np.radians((170.0, -40.0, 30.0)))
    fastest, before = 0.0, robot.attitude
    for _ in range(100):
        robot.run(0.05)
        turned = quaternion_log(quaternion_multiply(before * (1, -1, -1, -1), robot.attitude))
        fastest, before = max(fastest, float(np.linalg.norm(turned)) / 0.05), robot.attitude
    assert math.degrees(fastest) == pytest.approx(60.0, abs=0.1)
    assert abs(robot.attitude @ wanted) == pytest.approx(1.0, abs=1e-9)
    assert robot.height == pytest.approx(0.6)
    assert not robot.simulated.truth["angular_velocity_b"].any()
    assert not robot.simulated.truth["velocity_w"].any()


def test_motors_move_a_held_vehicle_nowhere() -> None:
    robot = Robot(held="hand")
    robot.run(2.5)
    robot.turn_on((180, 60, 180, 60))
    robot.run(1.0)
    assert robot.simulated.rotor_speeds.max() > 170.0
    assert robot.simulated.truth["position_w"][0].tolist() == pytest.approx([0, 0, 0.6])
    assert robot.attitude.tolist() == [1, 0, 0, 0]


def test_let_go_it_is_set_down_level_and_stands_by_itself() -> None:
    robot = Robot(held="hand", hand_pitch=60.0, hand_yaw=90.0)
    robot.run(4.0)
    robot.configure(held="free")
    assert robot.simulated.held
    robot.run(4.0)
    assert not now(robot).simulated.held
    assert robot.height == pytest.approx(0.0, abs=1e-6)
    level = quaternion_from_euler(0.0, 0.0, math.radians(90.0))
    assert abs(robot.attitude @ level) == pytest.approx(1.0, abs=1e-6)


def test_the_accelerometer_feels_gravity_through_the_true_matrix_and_bias() -> None:
    robot = Robot(
        held="hand",
        hand_pitch=-90.0,
        accelerometer_noise=0.2,
        accelerometer_xx=1.05,
        accelerometer_yx=0.1,
        accelerometer_bias_x=0.5,
        accelerometer_bias_y=0.0,
        accelerometer_bias_z=-0.3,
    )
    robot.run(3.0)
    matrix, bias = robot.parameters.accelerometer_matrix, np.array((0.5, 0.0, -0.3))
    assert matrix @ (robot.measured() - bias) == pytest.approx([9.81, 0.0, 0.0], abs=0.05)


def test_by_default_the_sensor_s_axes_are_the_body_s() -> None:
    assert SimulatorParameters().accelerometer_matrix.tolist() == np.eye(3).tolist()


# ---------------------------------------------------------------- bench
def on_bench(motor: int, reference: int, seconds: float = 2.0, **parameters: object) -> Robot:
    robot = Robot(held="bench", **parameters)
    robot.run(0.1)
    a, b, c, d = (reference if k == motor else 0 for k in range(4))
    robot.turn_on((a, b, c, d))
    robot.run(1.0)
    robot.readings.clear()
    robot.run(seconds)
    return robot


@pytest.mark.parametrize(("motor", "sign"), [(0, 1), (1, -1), (2, 1), (3, -1)])
def test_the_sensor_under_the_turning_motor_gives_its_force_and_torque(
    motor: int, sign: int
) -> None:
    robot = on_bench(motor, 120)
    model = robot.parameters
    force = thrust_of_reference(120.0, model.motor_slope, model.motor_offset)
    assert np.mean([r.force for r in robot.readings]) == pytest.approx(force, abs=0.01)
    torque = sign * model.torque_ratio * force
    assert np.mean([r.torque for r in robot.readings]) == pytest.approx(torque, abs=2e-4)
    assert np.mean([r.speed for r in robot.readings]) == pytest.approx(120.0, abs=0.2)
    assert robot.simulated.truth["position_w"].tolist() == [[0, 0, 0]]


def test_readings_come_200_times_a_second_in_the_converters_steps() -> None:
    readings = on_bench(0, 100).readings
    assert len(readings) == pytest.approx(400, abs=2)
    for values, step in (
        ([r.force for r in readings], FORCE_STEP),
        ([r.torque for r in readings], TORQUE_STEP),
    ):
        apart = (np.array(values) - values[0]) / step
        assert np.abs(apart - apart.round()).max() < 1e-6, "whole steps beside the offset"
    assert np.std([r.force for r in readings]) == pytest.approx(0.02, rel=0.2)
    assert np.std([r.torque for r in readings]) == pytest.approx(0.0005, rel=0.2)


def test_no_reading_without_a_turning_motor_a_sensor_or_the_bench() -> None:
    assert not on_bench(0, 0, 0.5).readings
    assert not on_bench(0, 100, 0.5, bench_sensor="none").readings
    held = on_bench(0, 100, 0.1)
    held.configure(held="hand")
    held.readings.clear()
    held.run(0.2)
    assert not held.readings


def test_without_a_tachometer_the_speed_is_not_known() -> None:
    readings = on_bench(0, 100, 0.1, bench_sensor="force").readings
    assert readings
    assert all(math.isnan(r.speed) for r in readings)


def test_the_sensor_s_noise_is_its_own_and_of_the_seed() -> None:
    robots = [on_bench(0, 100, 0.2, seed=3), on_bench(0, 100, 0.2, seed=3)]
    assert robots[0].readings == robots[1].readings
    silent = on_bench(0, 100, 0.2, seed=3, bench_sensor="none")
    registers = [robot.simulated.firmware.registers.tolist() for robot in (robots[0], silent)]
    assert registers[0] == registers[1], "nothing else changes with it"
