"""The compiled onboard step equals the Python composition of the same parts."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.onboard.compiled_step import onboard_step, onboard_steps
from control.controller import GeometricController
from control.parameters import AttitudeGains, ControlParameters
from control.trajectories.figure_eight import FigureEight
from estimation.complementary import ComplementaryEstimator
from estimation.parameters import EstimationParameters
from extensions.batches.onboard import new_onboard, new_settings
from quadrotor.records import ACTUATORS, IMU_SAMPLE, POSE_SAMPLE, Record, new_reference, new_state
from quadrotor.vehicle_model import VehicleModel

PERIOD, TICKS = 0.002, 2000


def samples() -> Record:
    """Return four seconds of a shaky hover: every law works, nothing saturates for long."""
    print("seed 2013")
    rng = np.random.default_rng(2013)
    imu = np.zeros(TICKS, IMU_SAMPLE)
    imu["stamp_ns"] = np.arange(1, TICKS + 1) * 2_000_000
    imu["specific_force_b"] = rng.normal(size=(TICKS, 3)) * 0.3 + [0.0, 0.0, 9.81]
    imu["angular_velocity_b"] = rng.normal(size=(TICKS, 3)) * 0.1
    return imu


def first_pose() -> Record:
    pose = np.zeros(1, POSE_SAMPLE)
    pose["position_w"], pose["quaternion_wb"] = (0.1, -0.1, 1.0), (0.96, 0.0, 0.0, 0.28)
    return pose


@pytest.mark.parametrize("rates", ["nominal", "exact"])
def test_the_compiled_step_equals_the_python_composition(rates: str) -> None:
    trajectory, model = FigureEight((0.0, 0.0, 1.0)), VehicleModel()
    control = ControlParameters(attitude=AttitudeGains(rates=rates))
    estimator, controller = ComplementaryEstimator(), GeometricController()
    controller.configure(control, model.record())
    estimator.initialize(first_pose())
    state, reference, actuators = new_state(), new_reference(), np.zeros(1, ACTUATORS)

    onboard = new_onboard()
    onboard["estimator"] = estimator.memory
    settings = new_settings(trajectory, model, control, EstimationParameters())
    imu = samples()
    scaled = 0
    for k in range(TICKS):
        one = imu[k : k + 1]
        estimator.predict(one, PERIOD, state)
        trajectory.sample(k * PERIOD, reference)
        controller.step(state, reference, True, PERIOD, actuators)
        onboard_step(onboard, settings, one, k * PERIOD, True, PERIOD)
        for ours, theirs in (
            (onboard["state"], state),
            (onboard["actuators"], actuators),
            (onboard["reference"], reference),
        ):
            for name in ours.dtype.names or ():
                np.testing.assert_allclose(ours[name], theirs[name], rtol=1e-12, atol=1e-12)
        scaled += int(actuators["scaling"][0] < 1.0)
    assert scaled < TICKS / 2  # it was a flight
    np.testing.assert_allclose(
        onboard["controller"]["attitude_integral_b"],
        controller.memory["attitude_integral_b"],
        atol=1e-12,
    )
    assert np.abs(onboard["controller"]["attitude_integral_b"]).max() > 0.0


def test_many_steps_in_one_call_equal_single_calls() -> None:
    trajectory, imu = FigureEight((0.0, 0.0, 1.0)), samples()
    settings = new_settings(trajectory, VehicleModel(), ControlParameters(), EstimationParameters())
    one, many = new_onboard(), new_onboard()
    for onboard in (one, many):
        onboard["estimator"]["initialized"] = 1
        onboard["estimator"]["pose"][:, 2] = 1.0
    thrusts = np.zeros((TICKS, 4))
    onboard_steps(many, settings, imu, thrusts, True, PERIOD)
    for k in range(TICKS):
        onboard_step(one, settings, imu[k : k + 1], k * PERIOD, True, PERIOD)
        np.testing.assert_allclose(one["actuators"]["thrusts"][0], thrusts[k], rtol=1e-12)
    assert thrusts.std(axis=0).min() > 1e-3
