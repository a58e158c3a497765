"""A reference that leads the rotors: behind their lag, force and torque come as it wants them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from control.controller import GeometricController
from control.parameters import ControlParameters
from control.rotor_lead import SNAP_RATE_MAX, RotorLead
from quadrotor.records import ACTUATORS, new_reference, new_state
from quadrotor.rigid_body import motor_share
from quadrotor.vehicle_model import GRAVITY, VehicleModel

MODEL = VehicleModel()
TAU = MODEL.motor_time_constant
DT = 0.002


@pytest.mark.parametrize(
    ("field", "axis", "derivative"), [("acceleration_w", 2, "jerk_w"), ("snap_w", 0, "")]
)
def test_rotors_that_lag_give_what_a_reference_that_leads_wants(
    field: str, axis: int, derivative: str
) -> None:
    rate, peak = 4.0, 3.0
    share, late, given, errors = motor_share(TAU, DT), 0.0, 0.0, []
    lead, reference, state = RotorLead(MODEL.record()), new_reference(), new_state()
    for k in range(2000):
        wanted = peak * math.sin(rate * k * DT)
        reference[field][0, axis] = wanted
        if derivative:
            reference[derivative][0, axis] = peak * rate * math.cos(rate * k * DT)
        late += share * (wanted - late)
        led = lead.step(reference, state, MODEL.record(), DT)
        given += share * (led[field][0, axis] - given)
        if k * DT > 1.0:
            errors.append((wanted - late, wanted - given))
    without, with_lead = np.abs(errors).max(axis=0)
    assert without == pytest.approx(peak * rate * TAU, rel=0.05)
    assert with_lead < 0.05 * without


def test_a_reference_leads_along_the_thrust_alone_and_stays_itself() -> None:
    half = math.sqrt(0.5)
    reference, state = new_reference(), new_state()
    state["quaternion_wb"] = half, 0.0, half, 0.0  # z_B is x_W
    reference["acceleration_w"], reference["jerk_w"] = (1.0, 2.0, 3.0), (10.0, 20.0, 30.0)
    kept = reference.copy()
    found = RotorLead(MODEL.record()).step(reference, state, MODEL.record(), DT).copy()
    assert found["acceleration_w"][0] == pytest.approx([1.0 + 10.0 * TAU, 2.0, 3.0])
    assert reference == kept
    found["acceleration_w"] = kept["acceleration_w"]
    assert found == kept


def test_a_jump_of_the_snap_is_bounded_and_over_after_a_tick() -> None:
    lead, reference = RotorLead(MODEL.record()), new_reference()
    reference["snap_w"][0, 1] = -50.0
    first, second = (
        lead.step(reference, new_state(), MODEL.record(), DT)["snap_w"][0, 1] for _ in range(2)
    )
    assert first == pytest.approx(-50.0 - TAU * SNAP_RATE_MAX)
    assert second == -50.0


@pytest.mark.parametrize("leads", [False, True])
def test_the_thrust_of_a_climb_leads_in_a_controller_that_leads(leads: bool) -> None:
    controller, actuators = GeometricController(leads=leads), np.zeros(1, ACTUATORS)
    controller.configure(ControlParameters(), MODEL.record())
    reference = new_reference()
    reference["jerk_w"] = 0.0, 0.0, 5.0
    controller.step(new_state(), reference, True, DT, actuators)
    weight = MODEL.mass * GRAVITY
    assert actuators["wrench"][0, 0] - weight == pytest.approx(leads * MODEL.mass * 5.0 * TAU)
