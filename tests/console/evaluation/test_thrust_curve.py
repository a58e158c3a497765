"""The motor law is found from thrust and acceleration, whatever law was flown with."""

from __future__ import annotations

import numpy as np
import pytest

from console.evaluation.log_columns import FlownParameters
from console.evaluation.thrust_curve import ThrustCurve, find_curve
from quadrotor.records import Array
from quadrotor.vehicle_model import GRAVITY, VehicleModel

MASS, SLOPE, OFFSET, LAG = 1.3, 0.0115, 6.0, 0.03
VALUES = {f"model.{name}": value for name, value in VehicleModel().model_dump().items()}
TRUTH = {"motor_slope": SLOPE, "motor_offset": OFFSET}


def flown(amplitude: float, noise: float = 0.05) -> tuple[Array, Array, Array]:
    """Return times, commanded thrusts and specific forces of a flight up and down."""
    generator = np.random.default_rng(7)
    model, time = VehicleModel(), np.arange(0.0, 40.0, 0.004)
    reference = 145.0 + amplitude * np.sin(1.7 * time) + 0.5 * amplitude * np.sin(0.6 * time)
    thrust = 4.0 * np.square(model.motor_slope * (reference + model.motor_offset))
    speed, force, lag = reference[0], np.empty(len(time)), model.motor_time_constant
    for k, one in enumerate(reference):
        force[k] = 4.0 * (SLOPE * (speed + OFFSET)) ** 2 / MASS
        speed += -np.expm1(-0.004 / lag) * (one - speed)
    return time, thrust, force + generator.normal(0.0, noise, len(time))


def found(amplitude: float, truth: dict[str, float] | None = None) -> ThrustCurve:
    parameters = FlownParameters(dict(VALUES), dict(truth or {}))
    return find_curve(*flown(amplitude), MASS, 15.2, parameters)


def test_a_flight_up_and_down_finds_slope_and_offset() -> None:
    curve = found(8.0, TRUTH)
    assert curve.offset_found
    assert curve.slope == pytest.approx(SLOPE, rel=0.02)
    assert curve.offset == pytest.approx(OFFSET, abs=3.0)
    assert curve.metrics()["thrust_error_share"] < 0.005
    assert curve.record().good
    assert curve.record().values["model.mass"] == MASS


def test_a_hover_finds_the_thrust_there_and_keeps_the_offset() -> None:
    curve = found(0.0)
    assert not curve.offset_found
    assert curve.offset == VehicleModel().motor_offset
    hover = 4.0 * (SLOPE * (145.0 + OFFSET)) ** 2
    assert 4.0 * (curve.slope * (145.0 + curve.offset)) ** 2 == pytest.approx(hover, rel=0.002)
    assert "thrust_error_share" not in curve.limits()
    assert curve.record().warnings == ("not flown around: the offset is the earlier one",)
    assert hover / MASS != pytest.approx(GRAVITY, rel=0.01)  # the mass is given, not assumed
