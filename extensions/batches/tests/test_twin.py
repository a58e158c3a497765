"""The C++ twin computes the same from the same records: two implementations check each other."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.onboard.compiled_step import onboard_steps
from benchmarks.onboard.onboard import PERIOD, recorded, started
from benchmarks.peers.cpp_twin import BUILT, CppTwin
from control.parameters import GEOMETRIC, ControlParameters
from control.trajectories.figure_eight import FigureEight
from estimation.parameters import EstimationParameters
from extensions.batches.batch import Scenario, fly_batch, prepare
from extensions.batches.laws import NOTHING
from extensions.batches.onboard import new_onboard, new_settings
from quadrotor.vehicle_model import VehicleModel

pytestmark = pytest.mark.needs("gcc")


@pytest.fixture(scope="module")
def twin() -> CppTwin:
    return CppTwin()


def test_a_recorded_flight_gives_both_the_same_thrusts(twin: CppTwin) -> None:
    imu = recorded(1000)
    settings = new_settings(
        FigureEight((0.0, 0.0, 1.0)),
        VehicleModel(drag=0.2),
        ControlParameters(),
        EstimationParameters(),
    )
    ours, theirs = started(imu), started(imu)
    for one in (ours, theirs):  # the state of an observer
        found = one["controller"]["disturbance"]
        found["force_w"], found["torque_b"] = (0.5, -0.3, 0.2), (0.01, -0.02, 0.005)
        found["lift"], found["force_rate_w"] = 0.15, (0.1, 0.2, -0.3)
        found["force_curve_w"] = (2.0, -1.0, 3.0)
    thrusts = np.zeros((2, len(imu), 4))
    onboard_steps(ours, settings, imu, thrusts[0], True, PERIOD)
    twin.steps(theirs, settings, imu, thrusts[1], PERIOD)
    np.testing.assert_allclose(thrusts[1], thrusts[0], atol=1e-9)
    for part in ("state", "reference", "actuators", "controller"):
        for name in set(ours[part].dtype.names or ()) - {"disturbance"}:
            np.testing.assert_allclose(theirs[part][name], ours[part][name], atol=1e-9)
    assert np.ptp(thrusts[0], axis=0).min() > 0.01


def test_a_closed_loop_ends_where_the_twins_does(twin: CppTwin) -> None:
    scenario = Scenario(true_state=True, whole_references=False, disturbance_w=(0.3, 0.0, 0.0))
    without_lead = {GEOMETRIC: replace(NOTHING, leads=False)}
    flight = fly_batch([scenario], 10.0, others=without_lead)
    cases, plants = prepare([scenario])
    error = twin.fly_true_state(cases["settings"], plants, new_onboard(), 5000, 0.002)
    np.testing.assert_allclose(plants["x"][0, :3], flight.final["position_w"][0], atol=1e-9)
    np.testing.assert_allclose(plants["x"][0, 6:10], flight.final["quaternion_wb"][0], atol=1e-9)
    assert error == pytest.approx(flight.outcome["position_rms"][0], rel=0.01)


def test_it_is_loaded_from_a_folder_that_no_other_user_writes(twin: CppTwin) -> None:
    found = BUILT.stat()
    assert found.st_uid == os.getuid()
    assert not found.st_mode & 0o022
    assert str(twin._library._name).startswith(f"{BUILT}/")
