"""Take-off and landing in a closed loop, with a ground to push against."""

from __future__ import annotations

import numpy as np
import pytest

from control.behaviors.land import TOUCH_DOWN, touched_down
from control.behaviors.machine import BehaviorMachine
from control.behaviors.parameters import BehaviorParameters
from control.behaviors.table import BehaviorName
from quadrotor.records import Record, new_state
from quadrotor.vehicle_model import VehicleModel
from tests.control.flight import Flight

DT = 0.002


class Sortie:
    """Flight commanded by a behavior machine; `drift` is the error of the estimate."""

    def __init__(self, mass: float = 1.308) -> None:
        self.f = Flight(ground=True, motors_ready=False, believed=VehicleModel(mass=mass))
        weight = self.f.believed.mass * 9.81
        self.machine = BehaviorMachine(BehaviorParameters(), weight)
        self.airborne = False
        self.time_ns = 0
        self.heights: list[float] = []

    def run(self, seconds: float) -> None:
        f = self.f
        for _ in range(round(seconds / DT)):
            self.time_ns += round(DT * 1e9)
            if self.machine.name is BehaviorName.LAND and self.machine.landed:
                break
            thrust = float(f.actuators["wrench"][0, 0])
            self.machine.step(self.time_ns, DT, f.state, None, thrust, f.reference)
            idle = self.machine.name is BehaviorName.GROUND
            self.airborne = not idle and (self.airborne or f.x[2] > 0.03)
            f.advance(DT, self.airborne, idle)
            self.heights.append(float(f.x[2]))

    def flies(self, name: BehaviorName) -> bool:
        return self.machine.name is name

    def request(self, name: str, **arguments: float) -> None:
        self.machine.request(name, arguments, self.f.state, True, self.airborne)


def test_take_off_hover_and_land_by_themselves() -> None:
    s = Sortie()
    s.run(0.5)
    s.request("take_off", height=1.0)
    s.run(6.0)
    assert s.flies(BehaviorName.HOVER)
    assert np.abs(s.f.x[:3] - [0, 0, 1.0]).max() < 0.02
    assert max(s.heights) < 1.05
    s.request("land")
    before = len(s.heights)
    s.run(12.0)
    assert s.flies(BehaviorName.LAND)  # until the vehicle has tested the ground
    assert s.machine.landed
    descent = np.diff(s.heights[before:]) / DT
    assert descent.min() > -0.5  # no fall
    in_the_air = next(k for k, z in enumerate(s.heights[before:]) if z < 0.05) * DT
    assert 2.5 < in_the_air < 5.0  # 1 m at 0.3 m/s
    assert abs(s.f.x[2]) < 0.02


def test_before_lift_off_the_integrals_do_not_move() -> None:
    s = Sortie()
    s.request("take_off", height=1.0, speed=0.05)
    while s.f.x[2] <= 0.03 and s.time_ns < 5e9:
        assert not s.f.controller.memory["position_integral_w"].any()
        s.run(0.02)
    s.run(0.2)
    assert s.f.controller.memory["position_integral_w"].any()


@pytest.mark.parametrize("mass", [1.0, 1.6])
def test_touch_down_is_found_with_a_wrong_mass(mass: float) -> None:
    s = Sortie(mass)
    s.request("take_off", height=1.0)
    s.run(8.0)
    assert s.f.x[2] > 0.4
    s.request("land")
    s.run(15.0)
    assert s.machine.landed
    assert abs(s.f.x[2]) < 0.03


def test_a_take_off_can_be_taken_back_on_the_ground() -> None:
    s = Sortie()
    s.request("take_off", height=1.0, speed=0.05)
    s.run(0.1)
    s.request("land")
    s.run(8.0)
    assert s.machine.landed
    assert max(s.heights) < 0.05


def test_no_touch_down_is_seen_in_the_air() -> None:
    s = Sortie()
    s.request("take_off", height=2.0)
    s.run(8.0)
    for speed in (1.0, 0.05):
        s.request("land", speed=speed)
        while s.f.x[2] > 1.0 and s.time_ns < 60e9:
            assert not s.machine.landed
            s.run(0.05)
        s.request("hover")
        s.run(2.0)
        s.request("fly_to", z=1.2)
        s.run(3.0)
        assert s.airborne


def detector() -> Record:
    out = np.zeros(1, TOUCH_DOWN)
    out["thrust_max"], out["velocity_change_max"], out["dwell"] = 7.7, 0.2, 0.3
    return out


def detected_after(
    thrust: float, acceleration: float, velocity: float = 0.0, seconds: float = 2.0
) -> float | None:
    d, state = detector(), new_state()
    for k in range(round(seconds / DT)):
        state["velocity_w"][0, 2] = velocity + acceleration * k * DT
        if touched_down(d, DT, thrust, state):
            return k * DT
    return None


def test_touch_down_needs_low_thrust_and_an_unchanging_velocity_for_a_while() -> None:
    assert detected_after(5.0, 0.0) == pytest.approx(0.3, abs=0.01)
    assert detected_after(9.0, 0.0) is None
    assert detected_after(5.0, 5.0 / 1.308 - 9.81) is None  # falling


def test_touch_down_is_seen_on_a_dead_reckoned_state_that_drifts() -> None:
    # The vehicle rests; the estimate is 0.6 m/s and drifts by 0.3 m/s^2.
    found = detected_after(5.0, -0.3, velocity=-0.6)
    assert found is not None
    assert found < 0.4


def test_a_velocity_that_is_not_a_number_is_no_touch_down() -> None:
    assert detected_after(5.0, np.nan) is None
