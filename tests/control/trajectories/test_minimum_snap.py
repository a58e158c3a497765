"""Least snap: no other path through the way-points at these times has less, and bounds hold."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from benchmarks.onboard.trajectories import snap_cost, through
from control.trajectories.minimum_snap import minimum_snap, within
from control.trajectories.polynomial import Polynomial, hermite, motion_of
from control.trajectories.trajectory import sample_many
from tests.support.arrays import Array


def problem(rng: np.random.Generator, size: int) -> tuple[Array, Array]:
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.4, 3.0, size - 1))])
    return rng.normal(size=(size, 4)), times


def cost_by_quadrature(path: Polynomial, field: str, times: Array) -> float:
    nodes, weights = np.polynomial.legendre.leggauss(12)
    total = 0.0
    for a, b in pairwise(times):
        s = sample_many(path, 0.5 * (a + b) + 0.5 * (b - a) * nodes)[field]
        total += 0.5 * (b - a) * (weights * (s.reshape(12, -1) ** 2).sum(axis=1)).sum()
    return total


def test_the_cost_is_the_integral_of_the_squared_snap(rng: np.random.Generator) -> None:
    points, times = problem(rng, 5)
    path = minimum_snap(points, times)
    assert snap_cost(path) == pytest.approx(cost_by_quadrature(path, "snap_w", times), rel=1e-9)


@pytest.mark.parametrize("size", [2, 3, 4, 9])
def test_it_passes_the_way_points_and_joins_to_the_fourth_derivative(
    size: int, rng: np.random.Generator
) -> None:
    points, times = problem(rng, size)
    path = minimum_snap(points, times)
    at = sample_many(path, times)
    np.testing.assert_allclose(at["position_w"], points[:, :3], atol=1e-9)
    np.testing.assert_allclose(at["yaw"], points[:, 3], atol=1e-9)
    before, after = sample_many(path, times[1:-1] - 1e-10), sample_many(path, times[1:-1] + 1e-10)
    for field in ("velocity_w", "acceleration_w", "jerk_w", "snap_w", "yaw_acceleration"):
        size_of = 1.0 + np.abs(at[field]).max()
        np.testing.assert_allclose(before[field], after[field], atol=1e-6 * size_of, err_msg=field)


def test_moving_any_derivative_at_a_way_point_costs_more(rng: np.random.Generator) -> None:
    points, times = problem(rng, 5)
    path = minimum_snap(points, times)
    motion = np.stack([motion_of(sample_many(path, np.array([t]))) for t in times])
    # Yaw samples end at the acceleration; only positions are varied here.
    best = snap_cost(path)
    for node in (1, 2, 3):
        for order in (1, 2, 3, 4):
            for axis in range(3):
                for change in (-1e-2, 1e-2):
                    other = motion.copy()
                    other[node, axis, order] += change * (1 + abs(other[node, axis, order]))
                    pieces = [
                        hermite(other[k], other[k + 1], times[k + 1] - times[k]) for k in range(4)
                    ]
                    assert snap_cost(Polynomial(times, np.stack(pieces))) > best


def test_it_costs_less_than_hermite_pieces_with_catmull_rom_velocities(
    rng: np.random.Generator,
) -> None:
    for size in (3, 5, 8):
        points, times = problem(rng, size)
        best, other = minimum_snap(points, times), through(points, times)
        assert snap_cost(best) < 0.9 * snap_cost(other)
        yaw = [cost_by_quadrature(p, "yaw_acceleration", times) for p in (best, other)]
        assert yaw[0] < yaw[1]


def test_two_points_give_the_polynomial_of_ninth_order_from_rest_to_rest() -> None:
    points = np.array([[0.0, 0, 1, 0], [1.0, 2, 3, 1]])
    path, other = (f(points, np.array([0.0, 2.0])) for f in (minimum_snap, through))
    np.testing.assert_allclose(path.coefficients, other.coefficients, atol=1e-9)


def test_slowing_a_path_of_least_snap_leaves_it_one(rng: np.random.Generator) -> None:
    points, times = problem(rng, 6)
    slow, again = minimum_snap(points, times).slowed(2.5), minimum_snap(points, 2.5 * times)
    np.testing.assert_allclose(slow.times, again.times)
    np.testing.assert_allclose(slow.coefficients, again.coefficients, atol=1e-8)


BOUND = st.floats(0.2, 5.0)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 8), BOUND, BOUND, BOUND, BOUND)
@example(2120828, 7, 4.0, 2.78125, 2.0, 2.0)  # its shortest piece takes a small share of the time
def test_bounds_hold_and_one_of_them_is_reached(
    seed: int,
    size: int,
    speed: float,
    acceleration: float,
    yaw_rate: float,
    yaw_acceleration: float,
) -> None:
    points = np.random.default_rng(seed).uniform(-3, 3, size=(size, 4))
    path = within(
        points,
        speed=speed,
        acceleration=acceleration,
        yaw_rate=yaw_rate,
        yaw_acceleration=yaw_acceleration,
    )
    s = sample_many(path, np.linspace(0, path.duration, 400 * size))
    shares = [
        np.linalg.norm(s["velocity_w"], axis=1).max() / speed,
        np.linalg.norm(s["acceleration_w"], axis=1).max() / acceleration,
        np.abs(s["yaw_rate"]).max() / yaw_rate,
        np.abs(s["yaw_acceleration"]).max() / yaw_acceleration,
    ]
    assert 0.97 < max(shares) <= 1.0 + 1e-3


@pytest.mark.parametrize(
    ("points", "times", "message"),
    [
        (np.zeros((2, 3)), [0, 1], "shape"),
        (np.zeros((3, 4)), [0, 1, 1], "grow"),
        (np.zeros((2, 4)), [1, 2], "start at 0"),
        (np.zeros((2, 4)), [0, np.inf], "grow"),
        (np.full((2, 4), np.nan), [0, 1], "finite"),
    ],
)
def test_what_makes_no_path_is_refused(points: Array, times: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        minimum_snap(points, np.array(times, dtype=float))
