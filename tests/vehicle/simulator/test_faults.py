"""Faults of the simulated vehicle: motors, body, air, parameters, and what refuses them."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from bearing_sim.faults.fault import Fault
from quadrotor.errors import OutOfBoundsError
from quadrotor.parameters import ParameterStore
from quadrotor.plain_rotations import Array, rotate
from quadrotor.vehicle_model import GRAVITY
from tests.support.faulty_vehicle import STEP_S, Flown
from vehicle.simulator.board_firmware import BoardFirmware
from vehicle.simulator.faults.table import CATALOGUE
from vehicle.simulator.live_parameters import LiveParameters
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle.simulator.vibration import LINES
from vehicle_link.serial.ids import Id


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


def test_a_slung_load_takes_from_the_momentum_of_the_vehicle_what_gravity_gives_it() -> None:
    loaded, plain = Flown("vehicle.slung_load mass=0.2 length=0.5"), Flown("")
    for one in (loaded, plain):
        one.step()
        one.throw(5.0)
        one.simulated.rotor_speeds[:] = 150.0
    loaded.simulated._plant["load"][0, :3] = 0.0, 0.0, 4.5
    loaded.simulated._plant["load"][0, 3:] = 0.0
    began = 1e-9 * loaded.simulated.stamp_ns
    loaded.until(0.4)
    plain.until(0.4)
    mass = SimulatorParameters().mass
    alone, together = (mass * one.simulated.truth["velocity_w"][0, 2] for one in (plain, loaded))
    load = 0.2 * loaded.simulated._plant["load"][0, 5]
    assert together + load == pytest.approx(alone - 0.2 * GRAVITY * (0.4 - began), abs=1e-6)
    assert together < alone - 0.05


def test_a_slung_load_swings_with_its_period() -> None:
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


def extremes(declared: type[Fault]) -> Iterator[str]:
    """Yield the words of a fault: as it is declared, and with each number at its bounds."""
    yield ""
    for one in ParameterStore(declared()).descriptions():
        values = one.choices or (one.minimum, one.maximum)
        yield from (f"{one.name}={value}" for value in values)


@pytest.mark.parametrize("name", sorted(CATALOGUE.faults))
def test_every_fault_leaves_finite_readings_and_motion_at_its_bounds(name: str) -> None:
    for words in extremes(CATALOGUE.faults[name]):
        flown = Flown(f"{name} {words}", inflow_loss=0.02, drag=0.1)
        flown.throw(1.0, (0.1, 0.2, 0.3))
        flown.simulated.rotor_speeds[:] = 100.0
        flown.until(0.02)
        simulated = flown.simulated
        assert np.isfinite(simulated.truth["position_w"]).all(), words
        assert np.isfinite(simulated.truth["angular_velocity_b"]).all(), words
        assert np.isfinite(simulated._plant["specific_force_b"]).all(), words
        assert 0 < flown.count(Id.BATTERY) < 400, words
