"""Mass estimate in the law: one value for everything, chosen on the ground, without a jump."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from quadrotor.errors import OutOfBoundsError, RefusedError
from quadrotor.parameters import ParameterStore
from quadrotor.vehicle_model import GRAVITY
from tests.support.lab import Lab, flight_parameters
from vehicle.flight.flown_mass import USED_BY
from vehicle.parameters import new_parameters

TRUE_MASS = 1.308


class Flight(Lab):
    """Flight that stores mass (kg), thrust (N) and height over the reference of each tick."""

    def __init__(self, settings: dict[str, Any]) -> None:
        parameters = flight_parameters()
        ParameterStore(parameters).preset(settings)
        self.rows: list[tuple[float, float, float]] = []
        super().__init__(parameters)

    def advance(self) -> None:
        super().advance()
        stack = self.stack
        height = self.robot.truth["position_w"][0, 2] - stack.reference["position_w"][0, 2]
        self.rows.append(
            (stack.law.mass, float(stack.record["actuators"]["wrench"][0, 0]), float(height))
        )

    def land(self) -> None:
        self.start("land")
        self.wait_until(lambda v: not v.armed, what="touch-down", timeout=20)


@pytest.fixture(scope="module")
def flight() -> Flight:
    """Return a hovering flight after a take-off from 1.0 kg; the tests continue it in order."""
    flight = Flight({USED_BY: "estimate", "mass.initial": 1.0})
    return flight.hovering(settling=3.0, speed=0.2)


def test_the_take_off_is_held_back_by_an_initial_mass_that_is_too_low(flight: Flight) -> None:
    masses = np.array([mass for mass, _, _ in flight.rows])
    thrusts = np.array([thrust for _, thrust, _ in flight.rows])
    learns = int(np.flatnonzero(masses > 1.0)[0])
    assert (masses[:learns] == 1.0).all()
    climbing = np.flatnonzero(thrusts > 1.0 * GRAVITY)
    assert climbing[0] < learns - 500  # more than a second of thrust before it leaves the ground
    assert thrusts[:learns].max() == pytest.approx(TRUE_MASS * GRAVITY, rel=0.1)


def test_then_law_feed_forward_and_touch_down_go_by_one_estimate(flight: Flight) -> None:
    stack = flight.stack
    mass = stack.mass.mass
    assert mass == pytest.approx(TRUE_MASS, rel=0.01)
    assert stack.law.mass == mass
    assert stack.behaviors.hover_thrust == mass * GRAVITY
    assert stack.behaviors.model["mass"][0] == mass
    assert stack.record["actuators"]["wrench"][0, 0] == pytest.approx(mass * GRAVITY, rel=0.01)


def test_the_law_s_mass_never_jumps(flight: Flight) -> None:
    masses = [mass for mass, _, _ in flight.rows]
    assert np.abs(np.diff(masses)).max() < 0.003


def test_in_flight_the_choice_stays_with_the_reason(flight: Flight) -> None:
    with pytest.raises(RefusedError, match=r"mass.used_by stays estimate while armed.*thrust"):
        flight.change({USED_BY: "model"})
    with pytest.raises(RefusedError, match=r"mass.mass_min = 1.4 is too far"):
        flight.change({"mass.mass_min": 1.4})


def test_the_model_s_mass_does_nothing_meanwhile(flight: Flight) -> None:
    before = len(flight.rows)
    flight.change({"model.mass": 1.2})
    flight.wait(0.1)
    flight.change({"model.mass": TRUE_MASS})
    assert {round(mass, 2) for mass, _, _ in flight.rows[before:]} == {1.31}


def test_the_microcontroller_s_thrust_is_not_learnt_from(flight: Flight) -> None:
    flight.start("near_hovering")
    flight.wait(0.1)
    before = flight.stack.mass.mass
    flight.wait(0.5)
    assert flight.stack.mass.mass == before
    flight.start("brake")
    flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=10)
    flight.wait(2.0)
    assert flight.stack.mass.mass == pytest.approx(TRUE_MASS, rel=0.02)


def test_a_payload_sags_less_and_is_weighed_within_12_s(flight: Flight) -> None:
    flight.rows.clear()
    flight.robot.configure(flight.parameters.simulator.model_copy(update={"payload": 0.3}))
    flight.wait(12.0)
    flight.robot.configure(flight.parameters.simulator)
    assert min(height for _, _, height in flight.rows) > -0.22
    assert flight.stack.mass.mass == pytest.approx(TRUE_MASS + 0.3, rel=0.02)


def test_each_arming_begins_anew(flight: Flight) -> None:
    flight.land()  # without the payload, which is learnt in the descent
    assert flight.stack.law.mass == pytest.approx(TRUE_MASS, rel=0.05)
    flight.arm()
    flight.wait(0.1)
    assert flight.stack.law.mass == 1.0
    with pytest.raises(RefusedError, match="while armed"):
        flight.change({USED_BY: "model"})


def test_on_the_ground_the_law_goes_back_to_the_model(flight: Flight) -> None:
    flight.stack.modes.move(type(flight.stack.mode).READY, "disarmed")
    flight.change({USED_BY: "model"})
    assert flight.stack.law.mass == TRUE_MASS
    assert flight.stack.behaviors.hover_thrust == TRUE_MASS * GRAVITY


def test_zero_begins_with_the_model_s_mass() -> None:
    flight = Flight({}).ready()
    flight.change({USED_BY: "estimate", "model.mass": 1.5})
    assert flight.stack.law.mass == flight.stack.mass.mass == 1.5


def test_an_initial_mass_beyond_the_clamps_is_refused() -> None:
    store = ParameterStore(new_parameters())
    with pytest.raises(OutOfBoundsError, match=r"mass.initial = 0.3 kg is not between"):
        store.set({"mass.initial": 0.3})
    assert store.get("mass.initial") == 0.0
