"""The microcontroller alone: its estimates, its flight, and its landing."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from quadrotor.motor_state import MotorState
from vehicle.simulator.firmware.firmware import Firmware
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.sensors import ACCELEROMETER_SCALE
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle_link.serial import commands as c
from vehicle_link.serial.attitude_command import AttitudeCommand
from vehicle_link.serial.ids import FlightControlMode, Id

TOUCHING = 0.005  # m


class Alone:
    """Simulated vehicle whose microcontroller is reached only by bytes."""

    def __init__(self, **truth: Any) -> None:
        self.robot = SimulatedVehicle(SimulatorParameters(**truth))
        firmware = self.robot.firmware
        assert isinstance(firmware, Firmware)
        self.firmware = firmware
        self.line = self.robot.ports[0]
        self.rest(1.0)

    @property
    def height(self) -> float:
        return float(self.robot.truth["position_w"][0, 2])

    @property
    def velocity_w(self) -> Any:
        return self.robot.truth["velocity_w"][0]

    @property
    def angles(self) -> tuple[float, float]:
        """Return the true roll and pitch, rad."""
        w, x, y, z = self.robot.truth["quaternion_wb"][0]
        roll = math.atan2(2 * (y * z + w * x), 1 - 2 * (x * x + y * y))
        return roll, math.asin(2 * (w * y - x * z))

    def rest(self, duration: float) -> None:
        self.go(duration, lambda: b"")

    def go(self, duration: float, frame: Callable[[], bytes]) -> None:
        for _ in range(round(duration * 500)):
            self.line.write(frame())
            self.step()

    def step(self) -> None:
        self.robot.step()
        for port in self.robot.ports:
            port.read()

    def set(self, id: Id, value: int) -> None:
        self.line.write(c.encode_set(AttitudeCommand(0, 0, 0, 1.0).encode(), id, value))
        self.step()

    def hover(self, height: float, duration: float, roll: float = 0, pitch: float = 0) -> None:
        """Hover by the true height; nothing controls the position."""
        p = self.robot.parameters
        share = p.mass / (1.308 * p.thrust_efficiency)

        def command() -> bytes:
            lift = (2.0 * (height - self.height) - 3.0 * self.velocity_w[2]) / 9.81
            return c.encode_command(AttitudeCommand(roll, pitch, 0.0, share * (1 + lift)).encode())

        self.go(duration, command)

    def take_off(self, height: float) -> None:
        self.set(Id.FLIGHT_CONTROL_MODE, FlightControlMode.NEAR_HOVERING)
        self.set(Id.MOTOR_STATE, MotorState.ON)
        self.hover(height, 2.0 + height)

    def climb(self, speed: float, height: float) -> None:
        """Climb at this speed (m/s) from the ground up to a true height."""
        self.set(Id.FLIGHT_CONTROL_MODE, FlightControlMode.NEAR_HOVERING)
        self.set(Id.MOTOR_STATE, MotorState.ON)
        aim = 0.0
        while self.height < height:
            aim += 0.002 * speed
            lift = (2.0 * (aim - self.height) + 3.0 * (speed - self.velocity_w[2])) / 9.81
            self.line.write(c.encode_command(AttitudeCommand(0, 0, 0.0, 1 + lift).encode()))
            self.step()

    def land(self) -> float:
        """Send nothing until the motors are off; return the speed (m/s) down at the first touch."""
        impact = None
        for _ in range(500 * 30):
            speed = -float(self.velocity_w[2])
            self.step()
            if impact is None and self.height < TOUCHING:
                impact = speed
            if self.firmware.motor_state is MotorState.OFF:
                assert impact is not None, f"motors off at {self.height:.2f} m"
                return impact
        raise AssertionError(f"still {self.firmware.motor_state.name} at {self.height:.2f} m")


@pytest.mark.parametrize("height", [1.0, 2.0, 3.0])
@pytest.mark.parametrize(
    "truth",
    [{}, {"thrust_efficiency": 0.9}, {"mass": 1.6}, {"drag": 0.3}],
    ids=["nominal", "weak", "heavy", "drag"],
)
def test_left_alone_it_lands_upright_and_softly(height: float, truth: dict[str, float]) -> None:
    alone = Alone(**truth)
    alone.take_off(height)
    impact = alone.land()
    assert 0.05 < impact < 0.5
    assert max(map(abs, alone.angles)) < math.radians(3.0)
    alone.rest(0.5)
    assert np.abs(alone.velocity_w).max() < 0.05


@pytest.mark.parametrize("height", [0.006, 0.05, 0.2, 0.7])
@pytest.mark.parametrize("speed", [0.5, 1.0])
@pytest.mark.parametrize("seed", [4, 6])
def test_left_alone_in_a_climb_it_lands_softly(seed: int, speed: float, height: float) -> None:
    alone = Alone(seed=seed)
    alone.climb(speed, height)
    assert alone.land() < 0.5


def test_it_lands_from_a_slope_too() -> None:
    alone = Alone()
    alone.take_off(2.0)
    alone.hover(2.0, 0.4, roll=0.3, pitch=-0.2)
    assert max(map(abs, alone.angles)) > 0.2
    assert alone.land() < 0.8
    assert max(map(abs, alone.angles)) < math.radians(3.0)


def test_a_weak_battery_lands_it_while_commands_go_on() -> None:
    alone = Alone(battery_charge=0.1, battery_resistance=0.1)
    alone.take_off(1.0)
    alone.hover(1.0, 60.0)
    assert alone.firmware.motor_state is MotorState.OFF
    assert alone.height < TOUCHING + 0.005


@pytest.mark.parametrize("before", [0.0, 5.0])
@pytest.mark.parametrize("rate", [-30.0, -15.0, -5.0, 5.0, 15.0, 30.0])
def test_a_barometer_that_leaks_changes_neither_end_nor_impact(rate: float, before: float) -> None:
    """Leak by Pa/s from some s before the emergency on."""
    alone = Alone()
    alone.take_off(1.5)
    highest, hardest = 0.0, 0.0
    for k in range(round(10 * (before + 8.0))):
        truth = alone.robot.parameters
        leaked = truth.ground_pressure + 0.1 * rate
        alone.robot.configure(truth.model_copy(update={"ground_pressure": leaked}))
        if k < 10 * before:
            alone.hover(1.5, 0.1)
            continue
        for _ in range(50):
            sinking = -float(alone.velocity_w[2])
            alone.step()
            highest = max(highest, alone.height)
            if alone.height < TOUCHING:
                hardest = max(hardest, sinking)
        if alone.firmware.motor_state is MotorState.OFF:
            break
    assert alone.firmware.motor_state is MotorState.OFF
    assert alone.height < TOUCHING + 0.005
    assert highest < 1.7
    assert 0.05 < hardest < 1.0


@pytest.mark.parametrize(
    "change", [{"push_z": 3.0}, {"push_z": -3.0}, {"payload": 0.0}, {"wind_z": 8.0, "drag": 0.25}]
)
@pytest.mark.parametrize("at", [0.4, 1.0, 2.0])
def test_a_force_or_a_released_load_is_not_taken_for_the_ground(
    at: float, change: dict[str, float]
) -> None:
    alone = Alone(payload=0.4 if "payload" in change else 0.0)
    alone.take_off(1.5)
    alone.rest(at)
    alone.robot.configure(alone.robot.parameters.model_copy(update=change))
    assert alone.land() < 1.0


def test_a_descent_that_lasts_too_long_becomes_faster() -> None:
    """Doubt the barometer, while the accelerometer has a bias by which level flight sinks."""
    alone = Alone()
    alone.take_off(1.5)
    alone.set(Id.MOTOR_STATE, MotorState.EMERGENCY)
    program = alone.firmware.program
    program["doubted"] = 2 << 22
    program["felt_bias"] += round(0.04 / ACCELEROMETER_SCALE * 2**22)
    hardest = 0.0
    for _ in range(500 * 40):
        sinking = -float(alone.velocity_w[2])
        alone.step()
        program["doubted"] = 2 << 22
        if alone.height < TOUCHING:
            hardest = max(hardest, sinking)
        if alone.firmware.motor_state is MotorState.OFF:
            break
    assert alone.firmware.motor_state is MotorState.OFF
    assert alone.height < TOUCHING + 0.005
    assert 0.05 < hardest < 1.0


def test_an_emergency_on_the_ground_does_not_take_off() -> None:
    alone = Alone()
    alone.set(Id.FLIGHT_CONTROL_MODE, FlightControlMode.NEAR_HOVERING)
    alone.set(Id.MOTOR_STATE, MotorState.ON)
    alone.set(Id.MOTOR_STATE, MotorState.EMERGENCY)
    alone.rest(0.01)
    assert alone.firmware.motor_state is MotorState.OFF
    assert alone.height < 0.01


def test_the_cut_is_obeyed_in_the_emergency() -> None:
    alone = Alone()
    alone.take_off(1.0)
    alone.set(Id.MOTOR_STATE, MotorState.EMERGENCY)
    assert alone.firmware.motor_state is MotorState.EMERGENCY
    alone.set(Id.MOTOR_STATE, MotorState.OFF)
    alone.step()
    assert alone.firmware.references == (0, 0, 0, 0)


@pytest.mark.parametrize(("roll", "pitch"), [(0.15, 0.0), (0.0, -0.15), (-0.1, 0.1)])
def test_near_hovering_holds_the_angles_it_is_told(roll: float, pitch: float) -> None:
    alone = Alone()
    alone.take_off(2.0)
    alone.hover(2.0, 1.0, roll, pitch)
    assert alone.angles == pytest.approx((roll, pitch), abs=math.radians(1.5))
    alone.hover(2.0, 1.0)
    assert alone.angles == pytest.approx((0.0, 0.0), abs=math.radians(1.5))


def test_near_hovering_turns_at_the_rate_it_is_told() -> None:
    alone = Alone()
    alone.take_off(1.5)
    turn = c.encode_command(AttitudeCommand(0.0, 0.0, 0.5, 1.0).encode())
    alone.go(1.0, lambda: turn)
    rate = float(alone.robot.truth["angular_velocity_b"][0, 2])
    assert rate == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("mode", list(FlightControlMode))
def test_attitude_and_climb_are_estimated_in_every_mode(mode: FlightControlMode) -> None:
    """Hold the attitude of `estimate_attitude` and the climb against the truth."""
    alone = Alone()
    alone.take_off(2.0)
    if mode is FlightControlMode.DIRECT:
        references = alone.firmware.references
        frame = c.encode_set(references, Id.FLIGHT_CONTROL_MODE, mode)
        alone.line.write(frame)
        alone.go(0.3, lambda: c.encode_command(references))
        assert alone.firmware.references == references
    alone.robot.disturb((0.0, 0.0, 2.0))
    for _ in range(100):
        alone.line.write(c.encode_command(alone.firmware.command))
        alone.step()
    program = alone.firmware.program[0]
    assert program["climb"] / 2**22 == pytest.approx(alone.velocity_w[2], abs=0.1)
    shown = (alone.firmware.registers[[Id.ROLL, Id.PITCH]] / 10.0).tolist()
    true = np.degrees(alone.angles).tolist()
    assert shown == pytest.approx(true, abs=1.5)


@pytest.mark.parametrize("size", [1.0, 8.0])
def test_drift_is_found_while_it_stands(size: float) -> None:
    x, y = 2.0 * size, -1.5 * size
    alone = Alone(gyroscope_bias_x=x, gyroscope_bias_y=y, gyroscope_bias_z=size)
    alone.rest(4.0)
    drift = alone.firmware.registers[[Id.GYROSCOPE_DRIFT_X, Id.GYROSCOPE_DRIFT_Y]] / 100.0
    assert drift.tolist() == pytest.approx([x, y], abs=0.1)
    alone.take_off(1.0)
    assert alone.land() < 0.8
    assert max(map(abs, alone.angles)) < math.radians(3.0)


def test_a_motor_that_leaves_the_bus_stands_still_and_is_shown() -> None:
    alone = Alone()
    alone.take_off(1.0)
    alone.firmware.program["missing"] = 0b0010
    alone.hover(1.0, 0.01)
    assert alone.firmware.references[1] == 0
    assert alone.firmware.registers[Id.MOTOR_REFERENCE_2] == -1
    assert alone.firmware.registers[Id.MOTOR_REFERENCE_1] > 0
