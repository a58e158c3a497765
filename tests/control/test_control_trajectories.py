"""Trajectories: each derivative is the derivative of the one before, and no joint shows."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from control.trajectories.figure_eight import FigureEight
from control.trajectories.hover import Hover
from control.trajectories.line import Line
from control.trajectories.polynomial import motion_of, through, to_rest
from control.trajectories.ramped_phase import ramped_phase
from control.trajectories.retarget import Retarget
from control.trajectories.trajectory import sample_many
from quadrotor.records import new_reference

CHAIN = ["position_w", "velocity_w", "acceleration_w", "jerk_w", "snap_w"]
YAW_CHAIN = ["yaw", "yaw_rate", "yaw_acceleration"]


def moving():
    start = new_reference()
    start["position_w"] = (0.3, -0.2, 1.0)
    start["velocity_w"] = (0.5, 0.2, -0.1)
    start["acceleration_w"] = (0.3, -0.4, 0.2)
    start["jerk_w"] = (0.1, 0.2, 0.3)
    start["snap_w"] = (1.0, -1.0, 0.5)
    start["yaw"], start["yaw_rate"], start["yaw_acceleration"] = 3.0, 0.2, -0.1
    return start


def trajectories():
    points = np.array([[0, 0, 1, 0], [1, 0, 1.2, 0.5], [1, 1, 1, 1.0], [0, 1, 1, 0.0]])
    limits = {"speed": 0.8, "acceleration": 1.5}
    yaw_limits = {"yaw_rate": 1.0, "yaw_acceleration": 2.0}
    return {
        "hover": Hover((1.0, 2.0, 3.0), 0.5),
        "line": Line((0, 0, 1, 0), (2, -1, 1.5, 1.0), **limits),
        "short line": Line((0, 0, 1, 0), (0.1, 0, 1, 0), **limits),
        "turn": Line((0, 0, 1, 0), (0, 0, 1, 2.0), **limits),
        "eight": FigureEight((1.0, 2.0, 1.5), 0.4, laps=1, ramp=3.0),
        "to rest": to_rest(moving(), (1.0, 1.0, 1.5, -3.0), 3.0),
        "retarget": Retarget(moving(), (-1.0, 1.0, 1.5, -3.0), **limits, **yaw_limits),
        "through": through(points, np.array([0.0, 2.0, 3.5, 6.0])),
    }


@pytest.mark.parametrize("name", trajectories())
def test_every_derivative_is_that_of_the_one_before(name):
    trajectory = trajectories()[name]
    end = min(trajectory.duration, 10.0)
    times = np.linspace(0.0, end, 301)[1:-1]
    h = 1e-5
    before, here, after = (sample_many(trajectory, times + d) for d in (-h, 0.0, h))
    for chain in (CHAIN, YAW_CHAIN):
        for low, high in pairwise(chain):
            finite = (after[low] - before[low]) / (2 * h)
            size = 1.0 + np.abs(here[high]).max()
            np.testing.assert_allclose(here[high], finite, atol=2e-3 * size, err_msg=high)


@pytest.mark.parametrize("name", trajectories())
def test_position_to_snap_and_yaw_to_its_acceleration_are_continuous(name):
    trajectory = trajectories()[name]
    end = min(trajectory.duration, 12.0)
    times = np.linspace(1e-9, end + 0.1, 20001)
    samples = sample_many(trajectory, times)
    for field in CHAIN + YAW_CHAIN:
        jumps = np.abs(np.diff(samples[field], axis=0)).max()
        scale = np.abs(samples[field]).max() + 1e-3
        # A smooth signal moves by a few thousandths of its size from sample to sample.
        assert jumps < 0.03 * scale, field


@pytest.mark.parametrize("name", ["line", "short line", "turn", "eight", "through"])
def test_it_starts_and_ends_at_rest_and_stays(name):
    trajectory = trajectories()[name]
    for t in (-1.0, 0.0, trajectory.duration, trajectory.duration + 5.0):
        sample = sample_many(trajectory, np.array([t]))
        for field in CHAIN[1:] + YAW_CHAIN[1:]:
            np.testing.assert_allclose(sample[field], 0.0, atol=1e-8, err_msg=field)


def test_a_line_ends_where_it_was_sent_within_its_limits(rng):
    for _ in range(60):
        start, end = rng.normal(size=4), rng.normal(size=4) * rng.choice([1e-3, 1.0, 5.0])
        speed, acceleration = rng.uniform(0.2, 3.0, size=2)
        line = Line(
            tuple(start),
            tuple(end),
            speed=speed,
            acceleration=acceleration,
            yaw_rate=0.7,
            yaw_acceleration=1.1,
        )
        last = sample_many(line, np.array([line.duration]))
        np.testing.assert_allclose(last["position_w"][0], end[:3], atol=1e-9)
        assert np.cos(last["yaw"][0] - end[3]) == pytest.approx(1.0)
        assert abs(last["yaw"][0] - start[3]) <= np.pi + 1e-9
        s = sample_many(line, np.linspace(0, line.duration, 400))
        assert np.linalg.norm(s["velocity_w"], axis=1).max() <= speed * (1 + 1e-9)
        assert np.linalg.norm(s["acceleration_w"], axis=1).max() <= acceleration * (1 + 1e-9)
        assert np.abs(s["yaw_rate"]).max() <= 0.7 + 1e-9
        assert np.abs(s["yaw_acceleration"]).max() <= 1.1 + 1e-9


def test_a_long_line_reaches_its_speed():
    line = Line((0, 0, 1, 0), (10, 0, 1, 0), speed=0.5, acceleration=1.0)
    middle = sample_many(line, np.array([line.duration / 2]))
    assert middle["velocity_w"][0, 0] == pytest.approx(0.5)


def test_the_eight_has_the_paper_s_size_period_and_amplitudes():
    eight = FigureEight((1.0, 2.0, 1.5), 0.4, laps=3)
    assert eight.duration == pytest.approx(27.0)
    s = sample_many(eight, np.linspace(3.0, 24.0, 8401))
    span = s["position_w"].max(axis=0) - s["position_w"].min(axis=0)
    np.testing.assert_allclose(span, [1.0, 1.0, 0.4], atol=1e-4)
    assert np.ptp(s["yaw"]) == pytest.approx(2.0, abs=1e-4)
    lap = sample_many(eight, np.array([5.0, 13.0]))
    np.testing.assert_allclose(lap["position_w"][0], lap["position_w"][1], atol=1e-12)
    ends = sample_many(eight, np.array([0.0, 27.0]))
    np.testing.assert_allclose(ends["position_w"], [[1.0, 2.0, 1.5]] * 2, atol=1e-12)


def test_a_ramp_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="does not fit into 1 laps of 2 s"):
        FigureEight((0, 0, 1), period=2.0, laps=1, ramp=3.0)


def test_the_phase_has_no_end_when_its_total_is_infinite():
    out = np.empty(5)
    ramped_phase(1e6, 2.0, 1.0, np.inf, out)
    assert out.tolist() == [2.0 * (1e6 - 0.5), 2.0, 0.0, 0.0, 0.0]


def test_a_polynomial_meets_both_ends_and_turns_the_short_way():
    path = to_rest(moving(), (1.0, 1.0, 1.5, -3.0), 3.0)
    ends = sample_many(path, np.array([0.0, 3.0, 4.0]))
    np.testing.assert_allclose(motion_of(ends[:1]), motion_of(moving()), atol=1e-9)
    for k in (1, 2):
        np.testing.assert_allclose(ends["position_w"][k], [1.0, 1.0, 1.5], atol=1e-9)
        assert ends["yaw"][k] == pytest.approx(2 * np.pi - 3.0)
        np.testing.assert_allclose(ends["snap_w"][k], 0.0, atol=1e-7)


def test_a_retarget_meets_the_motion_and_the_goal_within_its_limits(rng):
    for k in range(40):
        start, end = new_reference(), (*rng.uniform(-2, 2, size=3), rng.uniform(-3, 3))
        start["position_w"] = rng.normal(size=3)
        v = rng.normal(size=3)
        start["velocity_w"] = 0.8 * v / np.linalg.norm(v)
        start["yaw"], start["yaw_rate"] = rng.uniform(-3, 3), 0.5
        if k % 2:  # straight ahead
            end = (*(start["position_w"][0] + 4.0 * start["velocity_w"][0]), 0.0)
        path = Retarget(start, end, speed=0.8, acceleration=1.5, yaw_rate=1.0, yaw_acceleration=2.0)
        s = sample_many(path, np.linspace(0, path.duration, 300))
        np.testing.assert_allclose(motion_of(s[:1]), motion_of(start), atol=1e-9)
        np.testing.assert_allclose(s["position_w"][-1], end[:3], atol=1e-9)
        assert np.cos(s["yaw"][-1] - end[3]) == pytest.approx(1.0)
        assert np.linalg.norm(s["velocity_w"], axis=1).max() < (0.82 if k % 2 else 1.13)
        assert np.linalg.norm(s["acceleration_w"], axis=1).max() < 1.51
        assert path.duration < 12.0


def test_way_points_are_passed_at_their_times():
    points = np.array([[0, 0, 1, 0], [1, 0, 1.2, 0.5], [1, 1, 1, 1.0]])
    times = np.array([0.0, 2.0, 5.0])
    s = sample_many(through(points, times), times)
    np.testing.assert_allclose(s["position_w"], points[:, :3], atol=1e-9)
    np.testing.assert_allclose(s["yaw"], points[:, 3], atol=1e-9)


@pytest.mark.parametrize(
    ("points", "times", "message"),
    [
        (np.zeros((2, 3)), [0, 1], "shape"),
        (np.zeros((1, 4)), [0], "shape"),
        (np.zeros((3, 4)), [0, 1, 1], "grow"),
        (np.zeros((2, 4)), [1, 2], "start at 0"),
        (np.zeros((2, 4)), [0, np.nan], "grow"),
    ],
)
def test_way_points_that_make_no_path_are_refused(points, times, message):
    with pytest.raises(ValueError, match=message):
        through(points, np.array(times, dtype=float))
