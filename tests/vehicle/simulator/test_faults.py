"""Faults of the simulated vehicle, by the values of its sensors, motors and motion."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest

from quadrotor.errors import OutOfBoundsError
from quadrotor.parameters import ParameterStore, ParameterValue
from quadrotor.plain_rotations import Array, quaternion_of, rotate
from quadrotor.vehicle_model import GRAVITY
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.closed_loop.batch import Scenario, prepare
from vehicle.simulator.board_firmware import BoardFirmware
from vehicle.simulator.live_parameters import LiveParameters
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.presets import ROUGH
from vehicle.simulator.sensors import ACCELEROMETER_SCALE, GYROSCOPE_SCALE, ZERO
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle.simulator.vibration import LINES
from vehicle_link.serial.ids import PRESSURE_OFFSET, Id, MotorState

QUIET = {
    **dict.fromkeys(("accelerometer_noise", "gyroscope_noise", "pressure_noise"), 0.0),
    **{f"accelerometer_bias_{axis}": 0.0 for axis in "xyz"},
    **{f"gyroscope_bias_{axis}": 0.0 for axis in "xyz"},
}
STEP_S = 0.002


def truth(faults: str, values: Mapping[str, ParameterValue]) -> SimulatorParameters:
    parameters = SimulatorParameters()
    ParameterStore(parameters).preset({**values, "faults": faults})
    return parameters


class Flown:
    """One simulated vehicle, stepped, with what it reads."""

    def __init__(self, faults: str, **values: float) -> None:
        self.simulated = SimulatedVehicle(truth(faults, {**QUIET, **values}))
        self.board = Microcontroller(self.simulated.ports, 0)
        self.samples = 0

    def step(self, command: tuple[int, int, int, int] | None = None) -> None:
        self.simulated.step()
        self.samples += len(self.board.receive())
        if command is not None:
            self.board.command(command)
        self.board.service(1e-9 * self.simulated.stamp_ns)

    def until(self, seconds: float) -> None:
        while self.simulated.stamp_ns < 1e9 * seconds - 1:
            self.step()

    def count(self, register: Id, axis: int = 0) -> int:
        return int(self.simulated.firmware.registers[register + axis])

    @property
    def pressure(self) -> int:
        return self.count(Id.PRESSURE) + PRESSURE_OFFSET

    @property
    def force(self) -> Array:
        """Return what the accelerometer reads, m/s^2."""
        counts = [self.count(Id.ACCELEROMETER_X, axis) - ZERO for axis in range(3)]
        return ACCELEROMETER_SCALE * np.array(counts)

    def throw(self, height: float = 2.0, spin: tuple[float, float, float] = (0, 0, 0)) -> None:
        """Put it into the air, turning with this angular velocity (rad/s), motors off."""
        self.simulated.place((0.0, 0.0, height))
        self.simulated.truth["angular_velocity_b"] = spin


def fly(faults: str, steps: int, **values: ParameterValue) -> tuple[list[object], bytes]:
    """Return every sample and the truth at the end of a flight with held references."""
    simulated = SimulatedVehicle(truth(faults, {**values, "seed": 5}))
    board = Microcontroller(simulated.ports, 0)
    board.set_motor_state(MotorState.ON)
    samples: list[object] = []
    for _ in range(steps):
        simulated.step()
        samples += board.receive()
        board.command((125, 126, 125, 125))
        board.service(1e-9 * simulated.stamp_ns)
    return samples, simulated.truth.tobytes()


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


def test_a_gap_loses_every_sample_of_its_time() -> None:
    flown = Flown("imu.gaps from=0.1 to=0.3")
    flown.until(0.098)
    before = flown.samples
    flown.until(0.298)
    assert flown.samples <= before + 2  # those that were on the line
    flown.until(0.5)
    assert flown.samples == pytest.approx(before + 100, abs=2)


def test_a_stuck_meter_does_not_see_the_voltage_sag() -> None:
    stuck = Flown("battery.stuck from=0.1; battery.sag resistance=1 from=0.2")
    seen = Flown("battery.sag resistance=1 from=0.2")
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
    assert 0.1 * held - stuck.simulated.battery_voltage > 0.5


def gains(flown: Flown) -> list[float]:
    found: list[float] = flown.simulated._plant["motor_gain"][0].tolist()
    return found


def test_a_motor_fades_and_flickers() -> None:
    flown = Flown("motors.fade motor=left gain=0.6 from=0.1 ramp=0.2; motors.flicker motor=rear")
    flown.until(0.2)
    np.testing.assert_allclose(gains(flown), (1, 0.8, 0.5, 1))
    flown.until(0.37)  # in the second half of a period of 0.1 s
    np.testing.assert_allclose(gains(flown), (1, 0.6, 1, 1))


def test_a_parameter_of_the_simulator_follows_a_schedule() -> None:
    flown = Flown(
        "simulator.payload value=0.4 from=0.1 to=0.3; simulator.failed_motor value=2 from=0.2"
    )
    mass = SimulatorParameters().mass
    for t, payload, left in ((0.098, 0.0, 1.0), (0.1, 0.4, 1.0), (0.25, 0.4, 0.0), (0.3, 0.0, 0.0)):
        flown.until(t)
        assert flown.simulated._plant["model"]["mass"][0] == mass + payload
        assert gains(flown)[1] == left


def test_faults_of_a_served_tracking_system_follow_a_schedule() -> None:
    flown = Flown("simulator.served.stopped value=true from=0.1 to=0.2")
    for t, stopped in ((0.098, False), (0.1, True), (0.198, True), (0.2, False)):
        flown.until(t)
        assert flown.simulated.acting.served.stopped is stopped
    assert not flown.simulated.parameters.served.stopped


def test_a_change_of_a_parameter_in_flight_keeps_what_is_on() -> None:
    flown = Flown("vehicle.slung_load mass=0.2 length=0.5; motors.fade motor=front gain=0.5")
    flown.throw(2.0)
    flown.until(0.1)
    load = flown.simulated._plant["load"][0].copy()
    flown.simulated.configure(flown.simulated.parameters.model_copy(update={"payload": 0.3}))
    np.testing.assert_array_equal(flown.simulated._plant["load"][0], load)
    assert gains(flown)[0] == 0.5
    flown.simulated.configure(flown.simulated.parameters.model_copy(update={"faults": ""}))
    assert gains(flown)[0] == 1.0
    assert flown.simulated._plant["load_mass"][0] == 0.0


def test_an_unbalanced_rotor_shakes_at_its_speed_with_the_stated_deviation() -> None:
    flown = Flown("motors.imbalance motor=rear vibration=1.0")
    lines = flown.simulated
    flown.until(0.01)
    sensors = lines._sensors[0]
    amplitude = sensors["vibration"] * LINES * sensors["imbalance"]
    np.testing.assert_allclose(amplitude, (0, 0, math.sqrt(2.0), 0), atol=1e-12)
    both = Flown("motors.imbalance motor=rear vibration=1.0", vibration=0.5)
    both.until(0.01)
    plain = Flown("", vibration=0.5)
    sensors, before = both.simulated._sensors[0], plain.simulated._sensors[0]
    added = sensors["vibration"] * sensors["imbalance"] - before["vibration"] * before["imbalance"]
    np.testing.assert_allclose(LINES * added, (0, 0, math.sqrt(2.0), 0), atol=1e-12)


def test_thrust_turns_a_body_whose_centre_of_mass_is_off() -> None:
    flown = Flown("vehicle.centre x=0.01 y=-0.02")
    flown.throw(5.0)
    flown.simulated.rotor_speeds[:] = 120.0
    plain = Flown("")
    plain.throw(5.0)
    plain.simulated.rotor_speeds[:] = 120.0
    for one in (flown, plain):
        one.step()
        one.step()
    turn = flown.simulated.truth["angular_velocity_b"][0]
    lift = plain.simulated._plant["specific_force_b"][0, 2] * plain.simulated.parameters.mass
    inertia = plain.simulated._plant["model"]["inertia_b"][0]
    assert abs(plain.simulated.truth["angular_velocity_b"][0]).max() < 1e-12
    np.testing.assert_allclose(
        turn[:2], STEP_S * lift * np.array((0.02, 0.01)) / inertia[:2], rtol=0.05
    )


def test_products_of_inertia_keep_the_angular_momentum_of_a_free_body() -> None:
    flown = Flown("vehicle.inertia xy=0.3 xz=-0.2 yz=0.1")
    flown.step()
    flown.throw(8.0, (2.0, 3.0, -4.0))
    diagonal, (xy, xz, yz) = (
        flown.simulated._plant["model"]["inertia_b"][0],
        flown.simulated._plant["products_b"][0],
    )
    inertia = np.diag(diagonal) + np.array([[0, xy, xz], [xy, 0, yz], [xz, yz, 0]])

    def momentum_w() -> Array:
        truth = flown.simulated.truth[0]
        momentum_b = inertia @ truth["angular_velocity_b"]
        return np.array(rotate(truth["quaternion_wb"].tolist(), momentum_b))

    before, spin = momentum_w(), flown.simulated.truth["angular_velocity_b"][0].copy()
    flown.until(0.5)
    np.testing.assert_allclose(
        momentum_w(), before, rtol=0.01, atol=0.01 * float(np.linalg.norm(before))
    )
    assert np.abs(flown.simulated.truth["angular_velocity_b"][0] - spin).max() > 0.3


def test_a_slung_load_weighs_on_the_vehicle_and_swings_with_its_period() -> None:
    flown = Flown("vehicle.slung_load mass=0.2 length=1.0")
    flown.throw(3.0)
    flown.step()
    plant = flown.simulated._plant
    plant["load"][0, :3] = (math.sin(0.1), 0.0, 3.0 - math.cos(0.1))
    crossings, last = [], 1.0
    for _ in range(2000):
        flown.simulated.place((0.0, 0.0, 3.0))  # held still: the load alone moves
        flown.step()
        x = plant["load"][0, 0]
        if x * last < 0.0:
            crossings.append(1e-9 * flown.simulated.stamp_ns)
        last = x
    period = 2.0 * np.diff(crossings).mean()
    assert period == pytest.approx(2.0 * math.pi * math.sqrt(1.0 / GRAVITY), rel=0.01)
    far = np.linalg.norm(plant["load"][0, :3] - (0.0, 0.0, 3.0))
    assert far == pytest.approx(1.0, abs=0.002)


def test_air_and_walls_act_where_the_vehicle_is() -> None:
    flown = Flown(
        "world.updraught x=1 radius=0.5 speed=2; world.wall at=2 force=0.5 reach=0.5;"
        "world.wake y=5 speed_y=-10 radius=0.5 speed=3 from=0.1"
    )
    flown.simulated.place((1.0, 0.0, 2.0))
    flown.step()
    plant = flown.simulated._plant
    assert plant["wind_w"][0, 2] == pytest.approx(2.0, abs=1e-6)
    assert plant["disturbance_w"][0, 0] == pytest.approx(0.5 * math.exp(-2.0), abs=1e-6)
    flown.simulated.place((1.5, 0.0, 2.0))
    flown.step()
    flown.simulated.place((1.5, 0.0, 2.0))
    flown.step()
    assert plant["wind_w"][0, 2] == pytest.approx(2.0 * math.exp(-0.5), abs=1e-6)
    flown.simulated.place((2.5, 0.0, 9.0))
    flown.step()
    flown.step()
    assert plant["disturbance_w"][0, 0] == pytest.approx(-0.5 * math.exp(-1.0), abs=1e-4)
    flown.until(0.6)  # the wake has come by: y = 5 - 10 * 0.5
    flown.simulated.place((0.0, 0.0, 9.0))
    flown.until(0.602)
    expected = 2.0 * math.exp(-2.0) - 3.0 * math.exp(-0.5 * (0.02 / 0.5) ** 2)
    assert plant["wind_w"][0, 2] == pytest.approx(expected, abs=1e-3)


def test_a_fault_that_the_board_cannot_have_is_refused_at_the_start_and_in_flight() -> None:
    with pytest.raises(OutOfBoundsError, match=r"imu\.gaps.*this board sends a stream of bytes"):
        SimulatedVehicle(SimulatorParameters(faults="imu.gaps"), firmware=BoardFirmware())
    live = LiveParameters(SimulatorParameters(), BoardFirmware.lacking)
    with pytest.raises(OutOfBoundsError, match=r"simulator\.corrupted_bytes"):
        live.change({"simulator.faults": "simulator.lost_samples value=0.2"}, "test")
    assert live.values()["simulator.faults"] == ""
    applied, _ = LiveParameters(SimulatorParameters()).change({"simulator.faults": "imu.gaps"}, "")
    assert applied == {"simulator.faults": "imu.gaps"}


def test_a_batch_refuses_faults_that_it_would_leave_out() -> None:
    truth = SimulatorParameters(faults="motors.fade")
    with pytest.raises(OutOfBoundsError, match="no faults with schedules"):
        prepare([Scenario(truth=truth)])
