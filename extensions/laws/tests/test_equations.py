"""Each law against an independent script of its equations, at random states."""

from __future__ import annotations

import numpy as np
import pytest

from control.controller import GeometricController
from control.laws import example_arguments, extended, new_control_parameters, settings_of
from control.parameters import control_record
from extensions.laws.tests.equations import LAWS, Geometric, plain
from quadrotor.compiled import direct
from quadrotor.records import ACTUATORS, REFERENCE, STATE, Record
from quadrotor.vehicle_model import VehicleModel

DT, FLIGHTS, TICKS = 0.002, 250, 4


def random_state(rng: np.random.Generator) -> Record:
    x = np.zeros(1, STATE)
    x["position_w"], x["velocity_w"] = rng.normal(0.0, 0.2, 3), rng.normal(0.0, 0.5, 3)
    q = np.array([1.0, 0.0, 0.0, 0.0]) + rng.normal(0.0, 0.2, 4)
    x["quaternion_wb"], x["angular_velocity_b"] = q / np.linalg.norm(q), rng.normal(0.0, 0.6, 3)
    return x


def random_reference(rng: np.random.Generator) -> Record:
    r = np.zeros(1, REFERENCE)
    for name, size in (("position", 0.2), ("velocity", 1.0), ("acceleration", 1.5)):
        r[f"{name}_w"] = rng.normal(0.0, size, 3)
    r["jerk_w"], r["snap_w"] = rng.normal(0.0, 2.0, 3), rng.normal(0.0, 4.0, 3)
    r["yaw"], r["yaw_rate"], r["yaw_acceleration"] = rng.normal(0.0, 0.4, 3)
    return r


@pytest.mark.parametrize("name", LAWS)
def test_a_law_equals_its_equations(name: str) -> None:
    """1000 ticks of 250 flights; a few of them saturate and reach the limits of the force."""
    rng = np.random.default_rng(1)
    law, control = extended()[name].load(), new_control_parameters()
    settings, gains = settings_of(control, name), control_record(control)
    model = VehicleModel(drag=0.3, drag_lever=0.02).record()
    memory, actuators = law.new_memory(), np.zeros(1, ACTUATORS)
    step = direct(law.step, *example_arguments(law, settings))
    own, k, m = getattr(control, name), plain(gains), plain(model)
    worst, scaled = 0.0, 0
    for _ in range(FLIGHTS):
        memory[:] = 0
        script = LAWS[name]()
        actuators["motor_references"] = rng.uniform(90.0, 140.0, 4)
        for _ in range(TICKS):
            x, r = random_state(rng), random_reference(rng)
            wanted = script.step(own, plain(x), plain(r), k, m, plain(actuators), DT)
            step((memory, settings), (x, r, gains, model, actuators), True, True, DT)
            worst = max(worst, float(np.abs(actuators["wrench"][0] - wanted).max()))
            scaled += int(actuators["scaling"][0] < 1.0)
    assert worst < 1e-9
    assert 0 < scaled < FLIGHTS * TICKS  # with and without saturation


SIZES = {"force_w": 0.5, "lift": 0.3, "force_rate_w": 1.0, "force_curve_w": 5.0, "torque_b": 0.05}


def test_the_papers_law_equals_its_equations_with_any_disturbance_that_an_observer_found() -> None:
    rng = np.random.default_rng(2)
    controller, control = GeometricController(), new_control_parameters()
    gains, model = control_record(control), VehicleModel(drag=0.3, drag_lever=0.02).record()
    controller.configure(control, model)
    k, m, out = plain(gains), plain(model), np.zeros(1, ACTUATORS)
    worst, scaled = 0.0, 0
    for _ in range(FLIGHTS):
        controller.reset()
        script = Geometric()
        for _ in range(TICKS):
            x, r, off = random_state(rng), random_reference(rng), controller.disturbance
            for name, size in SIZES.items():
                off[name] = rng.normal(0.0, size, off[name].shape)
            wanted, _ = script.step(plain(off), plain(x), plain(r), k, m, DT)
            controller.step(x, r, True, DT, out)
            worst = max(worst, float(np.abs(out["wrench"][0] - wanted).max()))
            scaled += int(out["scaling"][0] < 1.0)
    assert worst < 1e-9
    assert 0 < scaled < FLIGHTS * TICKS  # with and without saturation
