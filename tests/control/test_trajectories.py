"""Trajectories: each derivative is the derivative of the one before, and joints are smooth."""

from __future__ import annotations

from itertools import pairwise
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from control.trajectories.circle import Circle, Nose, Side
from control.trajectories.figure_eight import FigureEight, sample_figure_eight
from control.trajectories.line import Hover, Line
from control.trajectories.minimum_snap import minimum_snap, within
from control.trajectories.polynomial import Polynomial, motion_of
from control.trajectories.ramped_phase import ramped_phase
from control.trajectories.retarget import Retarget
from control.trajectories.trajectory import Trajectory, grid_sampler, sample_many, stretches_of
from quadrotor.records import REFERENCE, Record, new_reference
from tests.support.arrays import Array

CHAIN = ["position_w", "velocity_w", "acceleration_w", "jerk_w", "snap_w"]
YAW_CHAIN = ["yaw", "yaw_rate", "yaw_acceleration"]


def moving() -> Record:
    start = new_reference()
    start["position_w"] = (0.3, -0.2, 1.0)
    start["velocity_w"] = (0.5, 0.2, -0.1)
    start["acceleration_w"] = (0.3, -0.4, 0.2)
    start["jerk_w"] = (0.1, 0.2, 0.3)
    start["snap_w"] = (1.0, -1.0, 0.5)
    start["yaw"], start["yaw_rate"], start["yaw_acceleration"] = 3.0, 0.2, -0.1
    return start


def trajectories() -> dict[str, Trajectory]:
    points = np.array([[0, 0, 1, 0], [1, 0, 1.2, 0.5], [1, 1, 1, 1.0], [0, 1, 1, 0.0]])
    limits = {"speed": 0.8, "acceleration": 1.5}
    yaw_limits = {"yaw_rate": 1.0, "yaw_acceleration": 2.0}
    return {
        "hover": Hover((1.0, 2.0, 3.0), 0.5),
        "line": Line((0, 0, 1, 0), (2, -1, 1.5, 1.0), **limits),
        "short line": Line((0, 0, 1, 0), (0.1, 0, 1, 0), **limits),
        "turn": Line((0, 0, 1, 0), (0, 0, 1, 2.0), **limits),
        "gentle line": Line((0, 0, 1, 0), (2, -1, 1.5, 1.0), jerk=1.0, **limits),
        "eight": FigureEight((1.0, 2.0, 1.5), 0.4, laps=1, ramp=3.0),
        "eight in one lap": FigureEight.in_one_lap((1.0, 2.0, 1.5), 0.4, duration=8.0),
        "circle": Circle((1.0, 2.0, 1.5, 0.4), laps=1),
        "tangent circle": Circle((1.0, 2.0, 1.5, 0.4), laps=1, nose="tangent", side="right"),
        "inward circle": Circle((1.0, 2.0, 1.5, 0.4), laps=1, nose="center"),
        "helix": Circle((1.0, 2.0, 1.5, 0.4), laps=1, nose="tangent", rise=-0.4),
        "least snap": minimum_snap(points, np.array([0.0, 2.0, 3.5, 6.0])),
        "least snap within": within(points, **limits, **yaw_limits),
        "retarget": Retarget(moving(), (-1.0, 1.0, 1.5, -3.0), **limits, **yaw_limits),
    }


@pytest.mark.parametrize("name", trajectories())
def test_every_derivative_is_that_of_the_one_before(name: str) -> None:
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
def test_position_to_snap_and_yaw_to_its_acceleration_are_continuous(name: str) -> None:
    trajectory = trajectories()[name]
    end = min(trajectory.duration, 12.0)
    times = np.linspace(1e-9, end + 0.1, 20001)
    samples = sample_many(trajectory, times)
    for field in CHAIN + YAW_CHAIN:
        jumps = np.abs(np.diff(samples[field], axis=0)).max()
        scale = np.abs(samples[field]).max() + 1e-3
        # A smooth signal moves by a few thousandths of its size from sample to sample.
        assert jumps < 0.03 * scale, field


@pytest.mark.parametrize("name", sorted(set(trajectories()) - {"hover", "to rest", "retarget"}))
def test_it_starts_and_ends_at_rest_and_stays(name: str) -> None:
    trajectory = trajectories()[name]
    for t in (-1.0, 0.0, trajectory.duration, trajectory.duration + 5.0):
        sample = sample_many(trajectory, np.array([t]))
        for field in CHAIN[1:] + YAW_CHAIN[1:]:
            # Horner's scheme leaves 1e-10 or so of coefficients of 1e3, over seconds^4.
            np.testing.assert_allclose(sample[field], 0.0, atol=1e-7, err_msg=field)


def test_a_line_ends_where_it_was_sent_within_its_limits(rng: np.random.Generator) -> None:
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


LENGTH = st.floats(-30.0, 30.0).filter(lambda x: x == 0.0 or abs(x) > 1e-6)
BOUND = st.floats(0.05, 20.0)


@settings(max_examples=60, deadline=None)
@given(LENGTH, LENGTH, LENGTH, st.floats(-9.0, 9.0), BOUND, BOUND, BOUND)
def test_a_line_of_any_length_keeps_to_velocity_acceleration_and_jerk(
    x: float, y: float, z: float, yaw: float, speed: float, acceleration: float, jerk: float
) -> None:
    line = Line((0, 0, 0, 0), (x, y, z, yaw), speed=speed, acceleration=acceleration, jerk=jerk)
    s = np.zeros(2000, REFERENCE)
    line.sample_grid(0.0, line.duration / 1999, s)
    np.testing.assert_allclose(s["position_w"][-1], [x, y, z], atol=1e-9)
    for field, bound in (("velocity_w", speed), ("acceleration_w", acceleration), ("jerk_w", jerk)):
        assert np.linalg.norm(s[field], axis=1).max() <= bound * (1 + 1e-9), field


@pytest.mark.parametrize(
    ("distance", "bounds", "reached"),
    [
        (10.0, (1.0, 2.0, 100.0), ("velocity_w", "acceleration_w")),
        (10.0, (1.0, 100.0, 2.0), ("velocity_w", "jerk_w")),
        (0.5, (9.0, 0.3, 100.0), ("acceleration_w",)),
        (0.5, (9.0, 9.0, 0.3), ("jerk_w",)),
    ],
)
def test_a_line_is_as_quick_as_its_tightest_bounds(
    distance: float, bounds: tuple[float, float, float], reached: tuple[str, str] | tuple[str]
) -> None:
    line = Line(
        (0, 0, 0, 0), (distance, 0, 0, 0), speed=bounds[0], acceleration=bounds[1], jerk=bounds[2]
    )
    s = sample_many(line, np.linspace(0, line.duration, 4001))
    fields = ("velocity_w", "acceleration_w", "jerk_w")
    for field, bound in zip(fields, bounds, strict=True):
        share = np.abs(s[field]).max() / bound
        assert share == pytest.approx(1.0, abs=1e-3) if field in reached else share < 1.0


def test_a_long_line_reaches_its_speed() -> None:
    line = Line((0, 0, 1, 0), (10, 0, 1, 0), speed=0.5, acceleration=1.0)
    middle = sample_many(line, np.array([line.duration / 2]))
    assert middle["velocity_w"][0, 0] == pytest.approx(0.5)


def test_the_eight_has_the_paper_s_size_period_and_amplitudes() -> None:
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


def test_a_ramp_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="does not fit into 1 laps of 2 s"):
        FigureEight((0, 0, 1), period=2.0, laps=1, ramp=3.0)


def test_one_lap_from_rest_to_rest_takes_its_time_and_the_whole_eight() -> None:
    lap = FigureEight.in_one_lap((0.0, 0.0, 1.0), duration=8.0)
    assert lap.duration == pytest.approx(8.0)
    s = sample_many(lap, np.linspace(0, 8, 4001))
    np.testing.assert_allclose(np.ptp(s["position_w"], axis=0), [1.0, 1.0, 0.4], atol=1e-4)
    middle = sample_many(lap, np.array([4.0]))
    np.testing.assert_allclose(middle["position_w"][0], [0.0, 0.0, 1.0], atol=1e-12)


NOSES: tuple[Nose, ...] = get_args(Nose)
SIDES: tuple[Side, ...] = get_args(Side)


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-3, 3),
    st.floats(0.05, 5),
    st.sampled_from(NOSES),
    st.sampled_from(SIDES),
    st.floats(-1, 1),
    st.integers(1, 4),
)
def test_a_helix_stays_on_its_cylinder_with_the_nose_where_it_was_told(
    yaw: float, radius: float, nose: Nose, side: Side, rise: float, laps: int
) -> None:
    start = (1.0, -2.0, 1.5, yaw)
    helix = Circle(start, radius=radius, nose=nose, side=side, rise=rise, laps=laps)
    s = np.zeros(1000, REFERENCE)
    grid_sampler(helix)(0.0, helix.duration / 999, s)
    turn = 1.0 if side == "left" else -1.0
    bearing = yaw if nose == "center" else yaw + turn * np.pi / 2
    center = np.array([1.0 + radius * np.cos(bearing), -2.0 + radius * np.sin(bearing)])
    arm = s["position_w"][:, :2] - center
    np.testing.assert_allclose(np.linalg.norm(arm, axis=1), radius, rtol=1e-9)
    np.testing.assert_allclose(s["position_w"][0], start[:3], atol=1e-9)
    np.testing.assert_allclose(
        s["position_w"][-1], [1.0, -2.0, 1.5 + laps * rise], atol=1e-9 * radius + 1e-9
    )
    about = arm[:, 0] * s["velocity_w"][:, 1] - arm[:, 1] * s["velocity_w"][:, 0]
    assert (turn * about >= -1e-12).all()
    ahead = np.stack([np.cos(s["yaw"]), np.sin(s["yaw"])], axis=1)
    if nose == "tangent":
        speed = np.linalg.norm(s["velocity_w"][:, :2], axis=1)
        np.testing.assert_allclose(
            (ahead * s["velocity_w"][:, :2]).sum(axis=1), speed, atol=1e-9 * (1 + radius)
        )
    elif nose == "center":
        np.testing.assert_allclose(ahead, -arm / radius, atol=1e-9)
    else:
        assert not s["yaw_rate"].any()


@settings(max_examples=30, deadline=None)
@given(st.integers(2, 9), st.floats(2, 20), st.floats(0.5, 18), st.sampled_from(NOSES))
def test_the_stretches_of_laps_hold_the_extremes_of_the_whole(
    laps: int, period: float, ramp: float, nose: Nose
) -> None:
    ramp = min(ramp, laps * period)
    for path in (
        FigureEight((0, 0, 1), period=period, laps=laps, ramp=ramp),
        Circle((0, 0, 1, 0), period=period, laps=laps, ramp=ramp, nose=nose),
    ):
        whole, seen = np.zeros(20000, REFERENCE), []
        grid_sampler(path)(0.0, path.duration / 19999, whole)
        last = 0.0
        for begin, end, count in stretches_of(path):
            assert last - 1e-9 <= begin < end <= path.duration + 1e-9
            part = np.zeros(count, REFERENCE)
            grid_sampler(path)(begin, (end - begin) / (count - 1), part)
            seen.append(part)
            last = end
        samples = np.concatenate(seen)
        for field in CHAIN[1:4]:
            most = np.linalg.norm(whole[field], axis=1).max()
            assert np.linalg.norm(samples[field], axis=1).max() >= 0.985 * most, field
        for axis in range(3):
            for sign in (-1, 1):
                most = (sign * whole["acceleration_w"][:, axis]).max()
                assert (sign * samples["acceleration_w"][:, axis]).max() >= 0.98 * most - 1e-9


@pytest.mark.parametrize("name", trajectories())
def test_a_grid_is_the_same_as_its_samples_one_by_one(name: str) -> None:
    trajectory = trajectories()[name]
    grid = np.zeros(50, REFERENCE)
    grid_sampler(trajectory)(0.3, 0.07, grid)
    single = sample_many(trajectory, 0.3 + 0.07 * np.arange(50.0))
    np.testing.assert_array_equal(grid.view("f8"), single.view("f8"))


def test_many_eights_are_sampled_at_once() -> None:
    eights = [FigureEight((k, 0, 1), period=6.0 + k) for k in range(3)]
    out = np.zeros(3, REFERENCE)
    sample_figure_eight(np.concatenate([e._eight for e in eights]), 2.5, out, 0.0)
    for k, eight in enumerate(eights):
        one = sample_many(eight, np.array([2.5]))
        np.testing.assert_array_equal(out[k : k + 1].view("f8"), one.view("f8"))


def moved_points(rng: np.random.Generator, points: Array, angle: float, shift: Array) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    out = points.copy()
    out[:, :2] = points[:, :2] @ np.array([[c, s], [-s, c]])
    return out + shift


@pytest.mark.parametrize("kind", ["circle", "moved", "least snap"])
def test_turning_and_shifting_the_start_turns_and_shifts_the_path(
    kind: str, rng: np.random.Generator
) -> None:
    angle, shift = 0.8, np.array([1.0, -2.0, 0.5, 0.8])
    points = rng.normal(size=(4, 4))
    times = np.array([0.0, 1.5, 2.5, 4.0])
    a: Circle | Polynomial
    b: Circle | Polynomial
    if kind == "circle":
        a = Circle((0, 0, 0, 0), nose="tangent", rise=0.2)
        b = Circle(tuple(shift), nose="tangent", rise=0.2)
    else:
        a = minimum_snap(points, times)
        if kind == "moved":
            b = a.moved(tuple(moved_points(rng, points[:1], angle, shift)[0]))
        else:
            b = minimum_snap(moved_points(rng, points, angle, shift), times)
    t = np.linspace(0.0, a.duration, 101)
    one, two = sample_many(a, t), sample_many(b, t)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    for field in CHAIN:
        wanted = one[field] @ turn.T
        if field == "position_w":
            wanted = wanted + shift[:3]
        np.testing.assert_allclose(two[field], wanted, atol=1e-7 * (1 + np.abs(wanted).max()))
    np.testing.assert_allclose(two["yaw"], one["yaw"] + angle, atol=1e-9)
    np.testing.assert_allclose(two["yaw_rate"], one["yaw_rate"], atol=1e-9)


def test_the_phase_has_no_end_when_its_total_is_infinite() -> None:
    assert ramped_phase(1e6, 2.0, 1.0, np.inf) == (2.0 * (1e6 - 0.5), 2.0, 0.0, 0.0, 0.0)


def test_a_retarget_meets_the_motion_and_the_goal_within_its_limits(
    rng: np.random.Generator,
) -> None:
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


def test_way_points_are_passed_at_their_times() -> None:
    points = np.array([[0, 0, 1, 0], [1, 0, 1.2, 0.5], [1, 1, 1, 1.0]])
    times = np.array([0.0, 2.0, 5.0])
    s = sample_many(minimum_snap(points, times), times)
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
def test_way_points_that_make_no_path_are_refused(
    points: Array, times: list[float], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        minimum_snap(points, np.array(times, dtype=float))
