"""Reference that follows a velocity command."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from control.trajectories.velocity_filter import advance, new_velocity_filter
from quadrotor.records import Record, new_reference

DT = 0.002
CHAIN = ["position_w", "velocity_w", "acceleration_w", "jerk_w", "snap_w"]


def moving() -> Record:
    reference = new_reference()
    reference["velocity_w"] = (0.8, -0.4, 0.2)
    reference["acceleration_w"] = (0.5, 0.3, -0.2)
    reference["jerk_w"] = (0.4, 0.1, 0.2)
    reference["yaw_rate"] = 0.5
    return reference


def test_velocity_follows_the_command_in_the_yaw_frame_of_the_reference() -> None:
    reference = new_reference()
    reference["yaw"] = np.pi / 2
    f = new_velocity_filter(reference, 2.0, 2.0)
    f["command"] = (1.0, 0.0, 0.3, 0.0)
    for _ in range(1500):
        advance(f, DT, reference)
    np.testing.assert_allclose(reference["velocity_w"][0], [0.0, 1.0, 0.3], atol=1e-4)


def test_the_acceleration_never_exceeds_its_limit(rng: np.random.Generator) -> None:
    reference = new_reference()
    f = new_velocity_filter(reference, 2.0, 2.5)
    for k in range(5000):
        if k % 100 == 0:
            f["command"] = rng.normal(size=4) * 2
        advance(f, DT, reference)
        assert np.abs(reference["acceleration_w"]).max() <= 2.0 + 1e-9
        assert abs(reference["yaw_acceleration"][0]) <= 2.5 + 1e-9


def test_each_derivative_integrates_to_the_one_before(rng: np.random.Generator) -> None:
    reference = moving()
    f = new_velocity_filter(reference, 2.0, 2.5)
    for k in range(800):
        if k % 200 == 0:
            f["command"] = rng.normal(size=4)
        before = reference.copy()
        advance(f, DT, reference)
        for low, high in pairwise(CHAIN):
            mean = 0.5 * (before[high] + reference[high]) if high != "snap_w" else reference[high]
            assert np.abs(reference[low] - before[low] - DT * mean).max() < 1e-5, low
        mean = 0.5 * (before["yaw_rate"] + reference["yaw_rate"])
        assert np.abs(reference["yaw"] - before["yaw"] - DT * mean).max() < 1e-5


def test_from_any_motion_it_comes_to_rest_and_says_so() -> None:
    reference = moving()
    f = new_velocity_filter(reference, 2.5, 2.5)
    ticks = next(k for k in range(5000) if advance(f, DT, reference))
    assert 0.2 < ticks * DT < 3.0
    assert np.abs(reference["velocity_w"]).max() < 1e-3


def test_it_starts_without_a_jump_in_snap_from_a_steady_acceleration() -> None:
    reference = moving()
    reference["jerk_w"] = 0.0
    f = new_velocity_filter(reference, 2.0, 2.0)
    f["command"] = 9.0
    advance(f, 1e-6, reference)
    assert np.abs(reference["snap_w"]).max() < 0.1


def test_walls_are_not_crossed_and_can_be_left(rng: np.random.Generator) -> None:
    reference = new_reference()
    reference["position_w"] = (0.0, 0.0, 1.0)
    f = new_velocity_filter(reference, 2.0, 2.0)
    f["low_w"], f["high_w"] = (-1.0, -1.0, 0.2), (1.0, 1.0, 2.0)
    for k in range(6000):
        if k % 600 == 0:
            f["command"] = rng.choice([-1.0, 1.0], size=4)
        advance(f, DT, reference)
        p = reference["position_w"][0]
        assert (p > f["low_w"][0] - 0.02).all()
        assert (p < f["high_w"][0] + 0.02).all()


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("speed", [1.0, 3.0, 5.0])
def test_no_speed_of_the_sticks_crosses_a_wall_and_each_comes_near_it(
    axis: int, side: float, speed: float
) -> None:
    reference = new_reference()
    f = new_velocity_filter(reference, 2.0, 2.0)
    f["low_w"], f["high_w"] = -20.0, 20.0
    f["command"][0, axis] = side * speed
    fastest = 0.0
    for _ in range(15_000):
        advance(f, DT, reference)
        assert abs(reference["position_w"][0, axis]) <= 20.0 + 1e-3
        fastest = max(fastest, abs(reference["velocity_w"][0, axis]))
    assert abs(reference["position_w"][0, axis]) > 19.9
    assert fastest == pytest.approx(speed, abs=0.02)


def test_from_outside_the_walls_it_comes_back() -> None:
    reference = new_reference()
    reference["position_w"] = (1.5, 0.0, 0.0)
    f = new_velocity_filter(reference, 2.0, 2.0)
    f["low_w"], f["high_w"] = (-1.0, -1.0, 0.2), (1.0, 1.0, 2.0)
    for _ in range(5000):
        advance(f, DT, reference)
    assert reference["position_w"][0, 0] < 1.01
    assert reference["position_w"][0, 2] > 0.19


@pytest.mark.parametrize("dt", [1 / 60, 0.5, 10.0])
def test_long_steps_stay_stable(dt: float) -> None:
    reference = moving()
    f = new_velocity_filter(reference, 2.0, 2.0)
    for _ in range(300):
        advance(f, dt, reference)
    assert np.abs(reference["velocity_w"]).max() < 1e-2
    assert np.abs(reference["position_w"]).max() < 2.0
