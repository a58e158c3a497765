"""A full battery and a new start for the simulated vehicle, with its motors off."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from quadrotor.errors import RefusedError
from quadrotor.motor_state import MotorState
from tests.support.arrays import Array
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.simulator import attendant as attendant_module
from vehicle.simulator.attendant import Attendant
from vehicle.simulator.live_parameters import CHARGE, LiveParameters
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.simulated_vehicle import SimulatedVehicle

FULL = 16.8
"""Voltage without load, of four cells, V."""
EMPTY = 13.0
START = (1.0, -2.0, 0.0)


class Robot:
    """Simulated vehicle away from its start with an empty battery; motors as commanded."""

    def __init__(self, **parameters: object) -> None:
        empty = {"start_x": START[0], "start_y": START[1], "battery_charge": 0.02}
        self.parameters = SimulatorParameters.model_validate(empty | parameters)
        self.simulated = SimulatedVehicle(self.parameters)
        self._mcu = Microcontroller(self.simulated.ports, 0)
        self.run(10)
        self.simulated.place((3.0, 3.0, 0.5), (0.0, 1.0, 0.0, 0.0))

    def turn(self, state: MotorState) -> None:
        self._mcu.set_motor_state(state)
        self.run(10)
        assert self.simulated.firmware.motor_state is state

    def run(self, samples: int) -> None:
        for _ in range(samples):
            self.simulated.step()
            self._mcu.receive()
            self._mcu.command((20, 20, 20, 20))
            self._mcu.service(self.simulated.stamp_ns * 1e-9)

    @property
    def place(self) -> Array:
        return np.array(self.simulated.truth["position_w"][0])


def test_a_swapped_battery_is_full_and_the_vehicle_stays() -> None:
    robot = Robot()
    before = robot.place
    assert robot.simulated.battery_voltage < EMPTY
    robot.simulated.swap_battery()
    assert robot.simulated.battery_voltage == pytest.approx(FULL)
    assert np.array_equal(robot.place, before)


def test_a_reset_vehicle_stands_at_its_start_at_rest_with_a_full_battery() -> None:
    robot = Robot()
    robot.simulated.reset()
    robot.run(100)
    assert robot.place == pytest.approx(START, abs=0.002)
    assert robot.simulated.truth["quaternion_wb"][0] == pytest.approx((1, 0, 0, 0), abs=0.001)
    assert robot.simulated.battery_voltage == pytest.approx(FULL, abs=0.2)


def test_neither_is_done_with_the_motors_on() -> None:
    robot = Robot()
    robot.turn(MotorState.ON)
    voltage, place = robot.simulated.battery_voltage, robot.place
    for act in (robot.simulated.swap_battery, robot.simulated.reset):
        with pytest.raises(RefusedError, match="motors are on"):
            act()
    assert robot.simulated.battery_voltage == voltage
    assert np.array_equal(robot.place, place)
    robot.turn(MotorState.OFF)
    robot.simulated.reset()


def test_a_vehicle_in_a_hand_is_not_put_elsewhere() -> None:
    robot = Robot(held="hand")
    with pytest.raises(RefusedError, match="holds it"):
        robot.simulated.reset()


def test_a_charge_that_is_set_acts_at_once_also_when_it_is_the_same_number() -> None:
    robot = Robot()
    robot.simulated.configure(robot.parameters.model_copy(update={"battery_charge": 0.5}))
    half = robot.simulated.battery_voltage
    assert EMPTY < half < FULL
    robot.simulated.configure(robot.parameters.model_copy(update={"battery_charge": 0.5}))
    assert robot.simulated.battery_voltage == half
    live = LiveParameters(SimulatorParameters())
    assert live.pop_charge() is None
    live.change({CHARGE: 1.0}, "anna")
    assert live.pop_charge() == 1.0
    assert live.pop_charge() is None
    live.change({"simulator.gust": 1.0}, "anna")
    assert live.pop_charge() is None


def test_the_loop_does_what_is_asked_and_who_asks_hears_of_it() -> None:
    robot, attendant = Robot(), Attendant()
    ended = threading.Event()

    def loop() -> None:
        while not ended.wait(0.001):
            attendant.attend(robot.simulated)

    thread = threading.Thread(target=loop)
    thread.start()
    try:
        attendant.ask("swap_battery")
        assert robot.simulated.battery_voltage == pytest.approx(FULL)
        attendant.ask("reset")
        assert robot.place == pytest.approx(START)
        with pytest.raises(RefusedError, match="allowed: swap_battery, reset"):
            attendant.ask("fly")
    finally:
        ended.set()
        thread.join()


def test_what_a_busy_loop_did_not_come_to_is_not_done_later(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(attendant_module, "PATIENCE", 0.01)
    robot, attendant = Robot(), Attendant()
    with pytest.raises(RefusedError, match="nothing was done"):
        attendant.ask("swap_battery")
    attendant.attend(robot.simulated)
    assert robot.simulated.battery_voltage < EMPTY
