"""Eqs. 6 to 10: convergence, gating, clamps, rates."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.identification import mass_estimator
from estimation.identification.mass_estimator import (
    MassEstimator,
    MassParameters,
    mass_record,
    new_mass_memory,
)
from quadrotor.records import ACTUATORS, ESTIMATE, STATE, new_state
from tests.support.narrowing import now

MASS, G = 1.308, 9.81


class Flight:
    """Vertical flight of a true mass under commanded thrust, ticked by hand."""

    def __init__(self, guess: float = 1.0, dt: float = 0.002, efficiency: float = 1.0) -> None:
        self.estimator = MassEstimator(guess)
        self.state, self.actuators = new_state(), np.zeros(1, ACTUATORS)
        self.estimate = np.zeros(1, ESTIMATE)
        self.dt, self.efficiency = dt, efficiency

    def fly(self, seconds: float, acceleration: float = 0.0, tilt: float = 0.0) -> None:
        """Command the thrust that accelerates upwards by `acceleration` (m/s^2)."""
        self.state["quaternion_wb"] = (math.cos(tilt / 2), math.sin(tilt / 2), 0.0, 0.0)
        thrust = MASS * (G + acceleration) / math.cos(tilt) / self.efficiency
        self.actuators["wrench"][0, 0] = thrust
        for _ in range(round(seconds / self.dt)):
            self.state["velocity_w"][0, 2] += acceleration * self.dt
            self.step(True)

    def stand(self, seconds: float, thrust: float) -> None:
        self.state["velocity_w"] = 0.0
        self.actuators["wrench"][0, 0] = thrust
        for _ in range(round(seconds / self.dt)):
            self.step(False)

    def step(self, airborne: bool) -> None:
        self.estimator.step(self.state, self.actuators, airborne, self.dt, self.estimate)

    @property
    def mass(self) -> float:
        return float(self.estimate["mass"][0])


@pytest.mark.parametrize("guess", [0.6, 1.0, 2.3])
def test_hover_converges_to_the_true_mass(guess: float) -> None:
    flight = Flight(guess)
    flight.fly(1.5)
    assert flight.mass == pytest.approx(MASS, rel=0.01)
    flight.fly(8.0)
    assert flight.mass == pytest.approx(MASS, abs=0.001)
    assert flight.estimator.mass == flight.mass


def test_erratic_and_tilted_motion_does_not_move_it(rng: np.random.Generator) -> None:
    flight = Flight()
    flight.fly(6.0)
    for _ in range(30):
        flight.fly(0.3, acceleration=float(rng.uniform(-4, 4)), tilt=float(rng.uniform(-0.6, 0.6)))
        assert flight.mass == pytest.approx(MASS, abs=0.002)


def test_thrust_efficiency_explains_the_papers_mass() -> None:
    flight = Flight(efficiency=0.938)
    flight.fly(10.0)
    assert flight.mass == pytest.approx(1.394, abs=0.001)


@pytest.mark.parametrize("dt", [0.1, 0.02, 0.0125, 0.004, 0.001])
def test_stable_at_any_rate(dt: float) -> None:
    """Explicit Euler diverges in hover below 82 Hz."""
    flight = Flight(dt=dt)
    flight.fly(30.0)
    assert flight.mass == pytest.approx(MASS, rel=1e-4)


def test_nothing_is_learnt_on_the_ground() -> None:
    flight = Flight(1.0)
    flight.stand(5.0, thrust=9.0)
    assert flight.mass == 1.0
    assert not flight.estimator.converged


def test_the_wait_on_the_ground_leaves_no_trace_in_flight() -> None:
    waited, fresh = Flight(1.0), Flight(1.0)
    waited.stand(20.0, thrust=5.0)
    waited.fly(0.5)
    fresh.stand(0.002, thrust=5.0)
    fresh.fly(0.5)
    assert waited.mass == fresh.mass


def test_lift_off_at_speed_is_exact_too() -> None:
    flight = Flight(MASS)
    flight.state["velocity_w"][0, 2] = 0.7
    flight.fly(2.0)
    assert flight.mass == pytest.approx(MASS, abs=1e-6)


def test_landing_keeps_the_estimate_for_the_next_flight() -> None:
    flight = Flight()
    flight.fly(6.0)
    learnt = flight.mass
    flight.stand(3.0, thrust=2.0)
    assert flight.mass == learnt
    flight.fly(3.0)
    assert flight.mass == pytest.approx(MASS, abs=0.001)


def test_variance_falls_in_flight_and_marks_convergence() -> None:
    flight = Flight()
    flight.step(False)
    assert flight.estimate["mass_variance"][0] > 0.1
    flight.fly(0.3)
    assert not flight.estimator.converged
    flight.fly(15.0)
    assert now(flight).estimator.converged
    assert flight.estimate["mass_variance"][0] < 1e-4


@pytest.mark.parametrize(("thrust", "wanted"), [(60.0, 2.4), (1.0, 0.5)])
def test_estimate_is_clamped(thrust: float, wanted: float) -> None:
    flight = Flight()
    flight.actuators["wrench"][0, 0] = thrust
    for _ in range(5000):
        flight.step(True)
    assert flight.mass == pytest.approx(wanted)


def test_no_thrust_stays_finite_and_clamped() -> None:
    flight = Flight()
    for _ in range(1000):
        flight.step(True)
    assert 0.5 <= flight.mass <= 2.4


def test_a_velocity_that_is_no_number_leaves_it_as_it_is() -> None:
    """The law may use it: a NaN that remained would reach the motors."""
    flight = Flight()
    flight.state["velocity_w"] = math.nan
    flight.step(True)
    flight.state["velocity_w"] = 0.0
    flight.fly(6.0)
    learnt = flight.mass
    flight.state["velocity_w"] = math.nan
    flight.step(True)
    assert flight.mass == learnt
    flight.state["velocity_w"] = 0.0
    flight.fly(1.0)
    assert flight.mass == pytest.approx(MASS, abs=0.002)


def test_zero_gain_holds() -> None:
    flight = Flight(1.0)
    flight.estimator.configure(MassParameters(gain=0.0))
    flight.fly(3.0)
    assert flight.mass == 1.0


def test_first_guess_is_clamped() -> None:
    assert MassEstimator(9.0).mass == pytest.approx(2.4)


def test_a_batch_equals_its_single_flights(rng: np.random.Generator) -> None:
    parameters = MassParameters()
    gains, batch = mass_record(parameters), new_mass_memory(1.0, parameters, 3)
    singles = [new_mass_memory(1.0, parameters) for _ in range(3)]
    states, actuators = np.zeros(3, STATE), np.zeros(3, ACTUATORS)
    states["quaternion_wb"][:, 0] = 1.0
    estimates, estimate = np.zeros(3, ESTIMATE), np.zeros(1, ESTIMATE)
    for _ in range(50):
        states["velocity_w"] = rng.normal(size=(3, 3))
        actuators["wrench"] = rng.uniform(5, 20, size=(3, 4))
        mass_estimator.step(batch, gains, states, actuators, True, 0.01, estimates)
        for k, single in enumerate(singles):
            one = slice(k, k + 1)
            mass_estimator.step(single, gains, states[one], actuators[one], True, 0.01, estimate)
            assert estimate["mass"][0] == estimates["mass"][k]
