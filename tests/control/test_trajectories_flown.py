"""The controller demands from the motors what the inverse dynamics predict."""

from __future__ import annotations

import numpy as np
import pytest

from control.trajectories.circle import Circle
from control.trajectories.feasibility import examine
from control.trajectories.figure_eight import FigureEight
from control.trajectories.limits import Limits
from control.trajectories.minimum_snap import within
from control.trajectories.trajectory import Trajectory
from quadrotor.vehicle_model import VehicleModel
from tests.control.flight import Flight

PATHS: dict[str, Trajectory] = {
    "eight": FigureEight((0, 0, 1), laps=1, period=5.0, ramp=3.0, yaw_amplitude=0.5),
    "one lap": FigureEight.in_one_lap((0, 0, 1), duration=9.0, yaw_amplitude=0.5),
    "circle": Circle((0, 0, 1, 0), radius=1.0, period=4.0, laps=1, ramp=3.0, nose="tangent"),
    "least snap": within(
        np.array([[0, 0, 1, 0], [1.5, 0, 1.5, 1], [1.5, 1.5, 1, 0], [0, 0, 1, -1.0]]),
        speed=1.5,
        acceleration=3.0,
        yaw_rate=1.0,
        yaw_acceleration=2.0,
    ),
}


@pytest.mark.parametrize("name", PATHS)
def test_tilt_thrusts_and_rate_in_flight_are_those_of_the_report(name: str) -> None:
    path = PATHS[name]
    report = examine(path, VehicleModel().record(), Limits())
    x, y, z, yaw = (0.0, 0.0, 1.0, 0.0)
    f = Flight()
    f.x[:3] = x, y, z
    f.x[6:10] = np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)
    tilts, rates, thrusts = [], [], []
    for k in range(round(path.duration / 0.002)):
        path.sample(k * 0.002, f.reference)
        f.advance()
        a, b = f.x[7], f.x[8]
        tilts.append(np.degrees(np.arccos(1.0 - 2.0 * (a * a + b * b))))
        rates.append(np.linalg.norm(f.x[10:13]))
        thrusts.append(f.actuators["thrusts"][0].copy())
    errors = np.linalg.norm(f.errors, axis=1)
    print(f"{name}: {1e3 * errors.max():.1f} mm, tilt {max(tilts):.1f} deg")
    assert errors.max() < 0.05
    assert min(f.scalings) == 1.0
    # The motors' lag makes the flight a little more lively than the plan.
    assert max(tilts) == pytest.approx(report.of("tilt").value, rel=0.08, abs=0.5)
    assert max(rates) == pytest.approx(report.of("body rate").value, rel=0.15)
    low, high = np.min(thrusts), np.max(thrusts)
    assert low == pytest.approx(report.of("least motor thrust").value, abs=0.3)
    assert high == pytest.approx(report.of("largest motor thrust").value, abs=0.3)
