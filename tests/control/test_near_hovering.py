"""Near-hovering law: exact about hover, useful in small flights, no more."""

from __future__ import annotations

import numpy as np
import pytest

from control.controller import Controller
from control.near_hovering import (
    ANGLE_MAX,
    YAW_RATE_MAX,
    NearHoveringController,
    hovering_command,
    hovering_torque,
)
from control.parameters import ControlParameters, control_record
from control.trajectories.figure_eight import FigureEight
from control.trajectories.line import Hover
from quadrotor.records import ACTUATORS, new_reference, new_state
from quadrotor.rotations import quaternion_from_euler, quaternion_to_matrix
from quadrotor.vehicle_model import VehicleModel
from tests.control.flight import Flight

WEIGHT = 1.308 * 9.81
MODEL = VehicleModel().record()


def hovering() -> Flight:
    f = Flight()
    f.controller = NearHoveringController()
    f.controller.configure(f.parameters, f.believed.record())
    return f


def test_small_commanded_angles_give_the_force_they_were_made_from(
    rng: np.random.Generator,
) -> None:
    for _ in range(100):
        yaw = rng.uniform(-3.1, 3.1)
        force = np.array([*rng.normal(size=2) * 1e-3 * WEIGHT, WEIGHT])
        thrust, roll, pitch, rate = hovering_command(tuple(force), WEIGHT, yaw, 0.2)
        R = quaternion_to_matrix(quaternion_from_euler(roll, pitch, yaw))
        np.testing.assert_allclose(R[:, 2] * thrust, force, atol=3e-5 * WEIGHT)
        assert (thrust, rate) == (WEIGHT, 0.2)


def test_commands_stay_within_what_their_bytes_carry() -> None:
    _, roll, pitch, rate = hovering_command((50.0, 50.0, WEIGHT), WEIGHT, 0.0, 9.0)
    assert (roll, pitch, rate) == (-ANGLE_MAX, ANGLE_MAX, YAW_RATE_MAX)
    assert np.degrees(ANGLE_MAX) == pytest.approx(31.75)


def test_the_torque_is_pid_on_the_angles_and_p_on_the_yaw_rate() -> None:
    gains, J = control_record(ControlParameters())[0], (0.0154, 0.0154, 0.0250)
    u = hovering_torque((0.1, -0.2, 0.3), (0.5, 0.6, 0.7), (0.01, 0.02, 9.0), gains, J)
    np.testing.assert_allclose(
        u,
        [
            J[0] * (60 * 0.1 + 10 * 0.01 - 12 * 0.5),
            J[1] * (60 * -0.2 + 10 * 0.02 - 12 * 0.6),
            J[2] * 5 * 0.3,
        ],
    )


def test_hover_on_the_reference_is_the_weight_on_four_equal_motors() -> None:
    controller: Controller = NearHoveringController()
    controller.configure(ControlParameters(), MODEL)
    out = np.zeros(1, ACTUATORS)
    controller.step(new_state(), new_reference(), True, 0.002, out)
    np.testing.assert_allclose(out["thrusts"][0], WEIGHT / 4)


def test_turning_vehicle_and_reference_about_the_vertical_changes_no_thrust(
    rng: np.random.Generator,
) -> None:
    for _ in range(20):
        e, yaw = 0.2 * rng.normal(size=3), rng.uniform(-3, 3)
        outs = []
        for turn in (0.0, yaw):
            controller = NearHoveringController()
            controller.configure(ControlParameters(), MODEL)
            state, reference, out = new_state(), new_reference(), np.zeros(1, ACTUATORS)
            state["quaternion_wb"] = quaternion_from_euler(0.1, -0.05, turn)
            Z = quaternion_to_matrix(quaternion_from_euler(0.0, 0.0, turn))
            reference["position_w"], reference["yaw"] = Z @ e, turn
            controller.step(state, reference, True, 0.002, out)
            outs.append(out["thrusts"][0].copy())
        np.testing.assert_allclose(outs[0], outs[1], atol=1e-12)


def test_a_step_and_a_turn_across_180_degrees_settle() -> None:
    f = hovering()
    f.x[6:10] = quaternion_from_euler(0.0, 0.0, 3.0)
    errors = f.fly(Hover((0.4, -0.3, 0.5), -3.0), 12.0)
    assert np.abs(errors[-500:]).max() < 0.02
    assert abs(f.yaw_errors[-1]) < 0.02
    assert max(map(abs, f.yaw_errors)) < 0.3  # the short way: 0.28 rad


def test_it_flies_the_eight_far_worse_than_the_geometric_law() -> None:
    eight = FigureEight((0.0, 0.0, 1.0), laps=2)
    rms = []
    for f in (hovering(), Flight()):
        f.x[2] = 1.0
        errors = f.fly(eight, 12.0)[1500:]
        rms.append(float(np.sqrt((errors**2).sum(axis=1).mean())))
    print(f"near hovering {1e3 * rms[0]:.1f} mm, geometric {1e3 * rms[1]:.1f} mm")
    assert 5 * rms[1] < rms[0] < 0.1


def test_integrals_freeze_on_the_ground_and_a_bad_state_gives_hover_thrust() -> None:
    controller = NearHoveringController()
    controller.configure(ControlParameters(), MODEL)
    reference, out = new_reference(), np.zeros(1, ACTUATORS)
    reference["position_w"] = 0.01
    controller.step(new_state(), reference, False, 0.002, out)
    assert not controller.memory["position_integral_w"].any()
    controller.step(new_state(), reference, True, 0.002, out)
    np.testing.assert_allclose(controller.memory["position_integral_w"], 0.01 * 0.002)
    state = new_state()
    state["position_w"] = np.nan
    controller.step(state, reference, True, 0.002, out)
    np.testing.assert_allclose(out["thrusts"][0], WEIGHT / 4)
