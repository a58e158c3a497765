"""The L1 estimate along flights whose every force and torque is known."""

from __future__ import annotations

import numpy as np
import pytest

from control.laws import example_arguments, extended, new_control_parameters, settings_of
from control.parameters import control_record
from extensions.laws.arena.courses import courses
from extensions.laws.geometric_l1 import MEMORY
from quadrotor.compiled import direct
from quadrotor.records import ACTUATORS, Record, new_reference, new_state
from quadrotor.vehicle_model import VehicleModel, reference_of_thrust
from vehicle.simulator.parameters import SimulatorParameters

DT = 0.002


def estimates(**truth: float) -> tuple[Record, Record]:
    """Return the adaptation, and the true motion, in each tick of 8 s on a fast 8."""
    batch = pytest.importorskip("extensions.batches.batch")
    control, model = new_control_parameters(), VehicleModel()
    one = batch.Scenario(
        truth=SimulatorParameters().model_copy(update=truth),
        model=model,
        trajectory=courses()["8 in 4 s"],
        true_state=True,
        whole_references=False,
        ground=False,
    )
    flown = batch.fly_batch([one], 8.0, history_rate=1.0 / DT).history[0]
    law, settings = extended()["geometric_l1"].load(), settings_of(control, "geometric_l1")
    memory, step = law.new_memory(), direct(law.step, *example_arguments(law, settings))
    state, reference, actuators = new_state(), new_reference(), np.zeros(1, ACTUATORS)
    records = state, reference, control_record(control), model.record(), actuators
    found = np.zeros(len(flown), MEMORY["adaptation"])
    for k in range(len(flown)):
        x = flown["truth"][k]
        state["position_w"], state["velocity_w"] = x[:3], x[3:6]
        state["quaternion_wb"], state["angular_velocity_b"] = x[6:10], x[10:]
        actuators["motor_references"] = [
            reference_of_thrust(thrust, model.motor_slope, model.motor_offset)
            for thrust in flown["thrusts"][max(0, k - 1)]
        ]
        step((memory, settings), records, True, True, DT)
        found[k] = memory.view(MEMORY)["adaptation"][0]
    return found[500:], flown["truth"][500:]


def test_nothing_is_found_where_the_model_is_the_vehicle() -> None:
    found, _ = estimates()
    assert np.abs(found["push_w"]).max() < 1e-3
    assert np.abs(found["turn_b"]).max() < 0.02


def test_a_heavier_vehicle_lacks_thrust_along_its_own_axis_only() -> None:
    found, motion = estimates(payload=0.262)
    _, x, y, _ = motion[:, 6:10].T
    up = 1.0 - 2.0 * (x * x + y * y)
    assert np.abs(found["across_w"]).max() < 0.01
    # (M - m)/m of the specific force, of which the weight's part is the largest
    assert found["lift"].mean() == pytest.approx(-9.807 * 0.262 / 1.308, rel=0.05)
    assert up.min() < 0.99
