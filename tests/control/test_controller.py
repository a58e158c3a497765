"""Whole controller: wind-up, limits, batches, parameters."""

from __future__ import annotations

import numpy as np
import pytest

from control.controller import Controller, GeometricController
from control.geometric_law import CONTROL_MEMORY, new_control_memory, step
from control.parameters import ControlParameters, control_record
from quadrotor.records import ACTUATORS, REFERENCE, STATE, Record, new_reference, new_state
from quadrotor.vehicle_model import VehicleModel, mixing_matrix
from tests.support.arrays import Array

MODEL = VehicleModel().record()
DT = 0.002


@pytest.fixture
def controller() -> GeometricController:
    out = GeometricController()
    out.configure(ControlParameters(), MODEL)
    return out


def run(
    controller: GeometricController,
    reference: Record,
    ticks: int = 1,
    airborne: bool = True,
    state: Record | None = None,
) -> Record:
    actuators = np.zeros(1, ACTUATORS)
    state = new_state() if state is None else state
    for _ in range(ticks):
        controller.step(state, reference, airborne, DT, actuators)
    return actuators


def at(*position: float, yaw: float = 0.0) -> Record:
    reference = new_reference()
    reference["position_w"], reference["yaw"] = position, yaw
    return reference


def integrals(controller: GeometricController) -> tuple[Array, Array]:
    memory = controller.memory[0]
    return memory["position_integral_w"].copy(), memory["attitude_integral_b"].copy()


def tilt_limited(controller: GeometricController) -> bool:
    return controller.tilt_limited


def test_hover_on_the_reference_is_the_weight_on_four_equal_motors(
    controller: GeometricController,
) -> None:
    out = run(controller, at(0, 0, 0))
    np.testing.assert_allclose(out["thrusts"][0], 1.308 * 9.81 / 4)
    np.testing.assert_allclose(out["motor_references"][0], 127.427, atol=1e-2)
    assert out["scaling"][0] == 1.0


def test_integrals_grow_by_the_error_times_dt(controller: GeometricController) -> None:
    run(controller, at(0.01, -0.02, 0.03), ticks=10)
    position, attitude = integrals(controller)
    np.testing.assert_allclose(position, np.array([0.01, -0.02, 0.03]) * 10 * DT, rtol=1e-12)
    assert attitude[1] > 0  # a force forward is a pitch forward, about +y
    assert attitude[0] > 0  # a force to the right (-y) is a roll about +x


def test_integrals_are_frozen_on_the_ground(controller: GeometricController) -> None:
    run(controller, at(0.01, 0.02, 0.03), ticks=10, airborne=False)
    assert not np.concatenate(integrals(controller)).any()


def test_integrals_are_frozen_while_the_motors_saturate(controller: GeometricController) -> None:
    out = run(controller, at(0, 0, 1.5), ticks=5)  # straight up: no tilt, too much thrust
    assert out["scaling"][0] < 1.0
    assert not controller.tilt_limited
    assert not np.concatenate(integrals(controller)).any()


def test_integrals_are_frozen_while_the_tilt_limit_acts() -> None:
    parameters = ControlParameters()
    parameters.limits.tilt_max = 5.0
    controller = GeometricController()
    controller.configure(parameters, MODEL)
    out = run(controller, at(0.4, 0, 0), ticks=5)
    assert out["scaling"][0] == 1.0
    assert tilt_limited(controller)
    assert not np.concatenate(integrals(controller)).any()
    run(controller, at(0.01, 0, 0))
    assert not tilt_limited(controller)
    assert integrals(controller)[0][0] > 0


def test_integrals_are_clamped_axis_by_axis() -> None:
    parameters = ControlParameters()
    # Gains too low to limit anything; only the integrals can end this.
    parameters.position.ki_xy = parameters.position.ki_z = 0.0
    parameters.attitude.ki_xy = 0.0
    controller = GeometricController()
    controller.configure(parameters, MODEL)
    run(controller, at(0.2, -0.2, -0.2), ticks=8000)
    position, attitude = integrals(controller)
    np.testing.assert_allclose(position, [1.0, -1.0, -1.0])
    assert np.abs(attitude).max() == pytest.approx(0.3)


def test_reset_empties_the_integrals(controller: GeometricController) -> None:
    run(controller, at(0.01, 0.02, 0.03), ticks=10)
    controller.reset()
    assert not np.concatenate(integrals(controller)).any()
    np.testing.assert_array_equal(controller.memory["desired_attitude"][0], np.eye(3))


def test_the_actuators_are_consistent_with_each_other(
    controller: GeometricController, rng: np.random.Generator
) -> None:
    M = mixing_matrix(0.25, 0.0174)
    for _ in range(200):
        out = run(controller, at(*rng.normal(size=3), yaw=rng.uniform(-3, 3)))
        thrusts = out["thrusts"][0]
        np.testing.assert_allclose(out["wrench"][0], M @ thrusts, atol=1e-12)
        root = 0.0126403 * (out["motor_references"][0] + 14.267)
        np.testing.assert_allclose(root**2, thrusts, rtol=1e-9)
        assert out["motor_references"].min() >= 30.0 - 1e-9
        assert out["motor_references"].max() <= 180.0 + 1e-9


def test_a_yaw_error_does_not_take_roll_and_pitch_authority(
    controller: GeometricController,
) -> None:
    out = run(controller, at(0, 0, 0, yaw=1.5))
    assert out["wrench"][0, 3] == pytest.approx(0.1)
    assert out["scaling"][0] == 1.0


def test_upside_down_keeps_torque_to_turn_upright(controller: GeometricController) -> None:
    state = new_state()
    state["quaternion_wb"] = [np.cos(1.4), np.sin(1.4), 0, 0]  # 160° of roll
    out = run(controller, at(0, 0, 3.0), state=state)
    assert out["scaling"][0] > 0.5
    assert out["wrench"][0, 1] < -0.1


@pytest.mark.parametrize("field", ["position_w", "velocity_w", "quaternion_wb"])
def test_a_state_that_is_not_a_number_gives_hover_thrust_and_moves_no_integral(
    controller: GeometricController, field: str
) -> None:
    run(controller, at(0.01, 0, 0), ticks=3)
    before, R_d = integrals(controller), controller.memory["desired_attitude"][0].copy()
    state = new_state()
    state[field] = np.nan
    out = run(controller, at(0.01, 0, 0), state=state)
    assert np.isfinite(out["motor_references"]).all()
    np.testing.assert_allclose(out["thrusts"][0], 1.308 * 9.81 / 4)
    np.testing.assert_array_equal(integrals(controller), before)
    if field != "quaternion_wb":  # then the force is still good
        np.testing.assert_array_equal(controller.memory["desired_attitude"][0], R_d)


def test_a_batch_equals_single_steps(rng: np.random.Generator) -> None:
    n = 5
    states, references = np.zeros(n, STATE), np.zeros(n, REFERENCE)
    for name in REFERENCE.names or ():
        references[name] = 0.3 * rng.normal(size=references[name].shape)
    states["position_w"] = 0.3 * rng.normal(size=(n, 3))
    q = np.array([1.0, 0, 0, 0]) + 0.2 * rng.normal(size=(n, 4))
    states["quaternion_wb"] = q / np.linalg.norm(q, axis=1, keepdims=True)
    gains = control_record(ControlParameters())
    memory, out = new_control_memory(n), np.zeros(n, ACTUATORS)
    step(memory, states, references, gains, MODEL, True, DT, out)
    for k in range(n):
        one, single = new_control_memory(), np.zeros(1, ACTUATORS)
        rows = (states[k : k + 1].copy(), references[k : k + 1].copy())
        step(one, *rows, gains, MODEL, True, DT, single)
        assert single.tobytes() == out[k : k + 1].tobytes()
        assert one.tobytes() == memory[k : k + 1].tobytes()


def test_idle_is_the_smallest_reference_on_all_motors(controller: GeometricController) -> None:
    out = np.zeros(1, ACTUATORS)
    controller.idle(out)
    np.testing.assert_allclose(out["motor_references"][0], 30.0)
    np.testing.assert_allclose(out["wrench"][0], [4 * float(MODEL["thrust_min"][0]), 0, 0, 0])


def test_an_unconfigured_controller_says_so() -> None:
    with pytest.raises(RuntimeError, match="before configure"):
        run(GeometricController(), at(0, 0, 0))


def test_gains_reach_the_record_each_in_its_place() -> None:
    parameters = ControlParameters()
    for component in (parameters.position, parameters.attitude):
        for k, name in enumerate(type(component).model_fields):
            if name != "rates":
                setattr(component, name, 1.0 + 0.1 * k)
    parameters.limits.tilt_max = 30.0
    r = control_record(parameters)[0]
    for x, z, names in (
        (1.0, 1.1, ("kp", "kr")),
        (1.2, 1.3, ("kv", "kw")),
        (1.4, 1.5, ("ki", "kf")),
    ):
        for name in names:
            assert r[name].tolist() == pytest.approx([x, x, z])
    assert r["tan_tilt_max"] == pytest.approx(np.tan(np.pi / 6))
    assert control_record(ControlParameters())["exact_rates"][0] == 0


def test_two_parameter_sets_share_nothing() -> None:
    first, second = ControlParameters(), ControlParameters()
    first.position.kp_xy = 9.0
    assert second.position.kp_xy == 4.0


def test_the_geometric_controller_is_a_controller(controller: GeometricController) -> None:
    plugin: Controller = controller
    assert controller.memory.dtype == CONTROL_MEMORY
    assert plugin.tilt_limited is False
