"""The rates that realise a wrench: the board's inner loop produces the torque of eq. 5."""

from __future__ import annotations

import numpy as np
import pytest

from control.parameters import ControlParameters, control_record
from control.rate_law import angles_of_rates, rates_of_wrench
from quadrotor.rotations import quaternion_from_euler
from quadrotor.vehicle_model import VehicleModel, thrust_of_reference

GAINS, MODEL = control_record(ControlParameters()), VehicleModel().record()
NO_LIMIT = 100.0


def test_a_rate_loop_of_the_laws_stiffness_makes_the_same_torque() -> None:
    generator = np.random.default_rng(23)
    J, kw = MODEL["inertia_b"][0], GAINS["kw"][0]
    for _ in range(20):
        omega = generator.normal(0.0, 2.0, 3)
        torque = generator.normal(0.0, 0.3, 3)
        wrench = np.array([12.0, *torque])
        rates = np.array(rates_of_wrench(wrench, omega, GAINS, MODEL, NO_LIMIT)[:3])
        made = J * kw * (rates - omega) + np.cross(omega, J * omega)
        np.testing.assert_allclose(made, torque, atol=1e-12)


def test_the_throttle_is_the_reference_that_gives_the_thrust() -> None:
    for thrust in (2.0, 12.83, 30.0):
        wrench = np.array([thrust, 0.0, 0.0, 0.0])
        throttle = rates_of_wrench(wrench, np.zeros(3), GAINS, MODEL, NO_LIMIT)[3]
        slope, offset = MODEL["motor_slope"][0], MODEL["motor_offset"][0]
        assert 4.0 * thrust_of_reference(255.0 * throttle, slope, offset) == pytest.approx(thrust)


def test_rates_and_throttle_stay_within_bounds() -> None:
    wrench = np.array([1000.0, 50.0, -50.0, 50.0])
    assert rates_of_wrench(wrench, np.zeros(3), GAINS, MODEL, 5.0) == (5.0, -5.0, 5.0, 1.0)


def test_an_angle_loop_that_is_given_the_angles_demands_the_rates() -> None:
    measured, rates, gain = (0.3, -0.2), (1.5, -0.7), 5.0
    given = angles_of_rates(quaternion_from_euler(*measured, 2.0), *rates, gain)
    demanded = [gain * (angle - now) for angle, now in zip(given, measured, strict=True)]
    np.testing.assert_allclose(demanded, rates, atol=1e-12)
