"""Faults of the sensors and the battery of the simulated vehicle, by the values that it reads."""

from __future__ import annotations

import math

import numpy as np
import pytest

from quadrotor.motor_state import MotorState
from quadrotor.plain_rotations import quaternion_of, rotate
from quadrotor.vehicle_model import GRAVITY
from tests.support.faulty_vehicle import QUIET, Flown, fly, truth
from vehicle.simulator.board_firmware import BoardFirmware
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.presets import ROUGH
from vehicle.simulator.sensors import ACCELEROMETER_SCALE, GYROSCOPE_SCALE, ZERO
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle_link.serial.ids import Id


def test_faults_that_are_off_change_no_bit_before_or_after() -> None:
    rough = {**ROUGH, "wind_x": 1.0}
    assert fly("", 600, **rough) == fly("motors.fade from=1000; imu.stuck from=999", 600, **rough)
    # Over again: every value is what it was, except for the gusts' memory.
    spent = "imu.scale to=0.1; imu.clip to=0.1; simulator.gust value=3 to=0.05"
    plain, after = (
        SimulatedVehicle(SimulatorParameters()),
        SimulatedVehicle(SimulatorParameters(faults=spent)),
    )
    for _ in range(100):
        plain.step()
        after.step()
    gusts = after._plant["gusts"].copy()
    after._plant["gusts"] = plain._plant["gusts"] = 0.0
    assert after._plant.tobytes() == plain._plant.tobytes()
    assert after._sensors.tobytes() == plain._sensors.tobytes()
    assert np.any(gusts)


def test_the_same_seed_gives_the_same_random_faults_and_another_one_others() -> None:
    text = "motors.fade motor=left gain=0.5 share=0.3 spell=0.05; imu.gaps share=0.2 spell=0.02"
    assert fly(text, 500) == fly(text, 500)
    assert fly(text, 500) != fly(text.replace("0.3", "0.31"), 500)


def test_the_pressure_of_a_ramp_is_p0_plus_rate_times_time() -> None:
    flown = Flown("barometer.ramp rate=15 from=0.2 to=0.6")
    flown.until(0.2)
    p0 = flown.pressure
    for t in (0.3, 0.4, 0.58):
        flown.until(t)
        assert flown.pressure == round(p0 + 15.0 * (t - 0.2))
    flown.until(0.62)
    assert flown.pressure == p0


def test_a_pressure_steps_and_sticks() -> None:
    flown = Flown("barometer.step pressure=40 from=0.1; barometer.stuck from=0.2 to=0.3")
    flown.until(0.1)
    p0 = flown.pressure - 40
    flown.until(0.2)
    flown.throw(10.0)
    flown.until(0.28)
    assert flown.pressure == p0 + 40
    flown.until(0.302)
    height = flown.simulated.truth["position_w"][0, 2]
    assert flown.pressure == pytest.approx(p0 + 40 - 11.6 * height, abs=1)


def test_a_stuck_axis_keeps_its_count_while_the_others_go_on() -> None:
    flown = Flown("imu.stuck sensor=gyroscope axis=y from=0.1 to=0.2")
    flown.throw(5.0, (1.0, 1.0, 0.0))
    flown.until(0.1)
    held = flown.count(Id.GYROSCOPE_X, 1)
    flown.simulated.truth["angular_velocity_b"] = (-2.0, -2.0, 0.0)
    flown.until(0.15)
    assert flown.count(Id.GYROSCOPE_X, 1) == held
    assert flown.count(Id.GYROSCOPE_X) - ZERO == pytest.approx(-2.0 / GYROSCOPE_SCALE, abs=2)
    flown.until(0.2)
    assert flown.count(Id.GYROSCOPE_X, 1) - ZERO == pytest.approx(-2.0 / GYROSCOPE_SCALE, abs=2)


def test_a_scale_a_turn_and_a_ramp_of_the_inertial_sensors() -> None:
    flown = Flown(
        "imu.scale axis=z factor=1.1 to=0.1; imu.misalignment x=10 from=0.1 to=0.2;"
        "imu.accelerometer_ramp x=1 z=0 from=0.2; imu.gyroscope_ramp x=0 z=10 from=0.2"
    )
    flown.until(0.05)
    half = 0.5 * ACCELEROMETER_SCALE + 1e-9
    np.testing.assert_allclose(flown.force, (0, 0, 1.1 * GRAVITY), atol=half)
    flown.until(0.15)
    turned = rotate(quaternion_of(math.radians(-10.0), 0, 0), (0, 0, GRAVITY))
    np.testing.assert_allclose(flown.force, turned, atol=half)
    flown.until(0.7)
    np.testing.assert_allclose(flown.force, (0.5, 0, GRAVITY), atol=half)
    assert flown.count(Id.GYROSCOPE_X, 2) - ZERO == round(math.radians(5.0) / GYROSCOPE_SCALE)


def test_readings_are_cut_off_at_the_range() -> None:
    flown = Flown("imu.clip accelerometer=5 gyroscope=50")
    flown.throw(5.0, (3.0, -3.0, 0.5))
    flown.until(0.01)
    counts = [flown.count(Id.GYROSCOPE_X, axis) - ZERO for axis in range(3)]
    end = round(math.radians(50.0) / GYROSCOPE_SCALE)
    assert counts == [end, -end, round(0.5 / GYROSCOPE_SCALE)]
    resting = Flown("imu.clip accelerometer=5 gyroscope=50")
    resting.until(0.01)
    assert resting.count(Id.ACCELEROMETER_X, 2) - ZERO == round(5.0 / ACCELEROMETER_SCALE)


def test_what_is_stuck_from_the_start_keeps_its_first_reading() -> None:
    flown = Flown("imu.stuck sensor=accelerometer axis=z; barometer.stuck; battery.stuck")
    flown.step()
    first = flown.force[2], flown.pressure, flown.count(Id.BATTERY)
    assert first[0] == pytest.approx(GRAVITY, abs=ACCELEROMETER_SCALE)
    assert first[1] == 96000
    assert first[2] == 168
    flown.throw(20.0)
    flown.until(0.1)
    assert (flown.force[2], flown.pressure, flown.count(Id.BATTERY)) == first


def test_a_gap_loses_every_sample_of_its_time() -> None:
    flown = Flown("imu.gaps from=0.1 to=0.3")
    flown.until(0.098)
    before = flown.samples
    flown.until(0.298)
    assert flown.samples <= before + 2  # those that were on the line
    flown.until(0.5)
    assert flown.samples == pytest.approx(before + 100, abs=2)


def test_a_stuck_meter_does_not_see_the_voltage_sag() -> None:
    stuck = Flown("battery.stuck from=0.1; battery.sag resistance=0.3 from=0.2")
    seen = Flown("battery.sag resistance=0.3 from=0.2")
    for flown in (stuck, seen):
        flown.board.set_motor_state(MotorState.ON)
        while flown.simulated.stamp_ns < 0.1e9 - 1:
            flown.step((100, 100, 100, 100))
    held = stuck.count(Id.BATTERY)
    for flown in (stuck, seen):
        while flown.simulated.stamp_ns < 0.5e9:
            flown.step((100, 100, 100, 100))
    assert stuck.count(Id.BATTERY) == held
    assert seen.count(Id.BATTERY) < held - 2
    assert stuck.simulated.battery_voltage < 0.1 * held - 0.2


class SenseOnly(BoardFirmware):
    """A board that does nothing but sense."""

    def period(self, command: tuple[int, int, int, int]) -> None: ...

    def next_data(self) -> tuple[int, bytes]:
        return 0, b""


def test_boards_with_finer_sensors_have_the_same_faults() -> None:
    text = (
        "imu.stuck sensor=accelerometer axis=z from=0.1; imu.clip accelerometer=4 from=0.2;"
        "imu.scale sensor=gyroscope axis=x factor=2; barometer.stuck from=0.1;"
        "battery.stuck from=0.1"
    )
    board = SenseOnly()
    simulated = SimulatedVehicle(truth(text, QUIET), firmware=board)

    def until(seconds: float) -> None:
        while simulated.stamp_ns < 1e9 * seconds - 1:
            simulated.step()

    until(0.099)
    held = board._sensed[0, 2], board._pressure, board.voltage
    assert held[0] == pytest.approx(GRAVITY, abs=1e-3)
    simulated.place((0.0, 0.0, 50.0))
    simulated.truth["angular_velocity_b"] = (0.5, 0.0, 0.0)
    simulated.charge_battery(0.3)
    until(0.15)
    assert (board._sensed[0, 2], board._pressure, board.voltage) == held
    assert board._sensed[1, 0] == pytest.approx(1.0, abs=1e-6)
    assert simulated.battery_voltage < held[2] - 0.5
    simulated.configure(truth("imu.clip accelerometer=4", QUIET))
    simulated.place((0.0, 0.0, 0.0))
    simulated.truth["angular_velocity_b"] = 0.0
    until(0.6)
    assert board._sensed[0, 2] == 4.0
    assert board._pressure == pytest.approx(96000.0, abs=0.1)
