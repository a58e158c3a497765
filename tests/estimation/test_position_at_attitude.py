"""Position from bearings with the attitude given."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimation.poses.position_at_attitude import position_at_attitude, position_covariance
from quadrotor.records import Array

SQUARE = np.array([[1, 1, 0.1], [1, -1, 0.1], [-1, -1, 0.1], [-1, 1, 0.1]])
SIGMA = math.radians(1.5)


def scene(rng: np.random.Generator, noise: float) -> tuple[Array, Array, Array]:
    """Return position, q_wb and bearings."""
    r = np.array([*rng.uniform(-1.2, 1.2, 2), rng.uniform(0.3, 2.0)])
    R = Rotation.from_euler("ZYX", [rng.uniform(-3, 3), *rng.uniform(-0.35, 0.35, 2)])
    d = SQUARE - r
    x = R.inv().apply(d / np.linalg.norm(d, axis=1)[:, None])
    noisy = x + noise * rng.normal(size=x.shape)
    noisy -= ((noisy - x) * x).sum(1)[:, None] * x
    return r, np.roll(R.as_quat(), 1), noisy / np.linalg.norm(noisy, axis=1)[:, None]


@pytest.mark.parametrize("count", [2, 3, 4])
def test_exact_bearings_give_the_exact_position(count: int, rng: np.random.Generator) -> None:
    out = np.empty(3)
    for _ in range(50):
        r, q, x = scene(rng, 0.0)
        start = r + rng.normal(0, 0.1, 3)
        cost = position_at_attitude(SQUARE[:count], x[:count], 3.0 * q, start, out)
        np.testing.assert_allclose(out, r, atol=1e-5)
        assert cost < 1e-10


def test_errors_are_those_of_the_covariance(rng: np.random.Generator) -> None:
    """Normalised squared errors of a 3-vector have mean 3, known here to 0.06."""
    out, P, squares = np.empty(3), np.empty((3, 3)), []
    for _ in range(2000):
        r, q, x = scene(rng, SIGMA)
        position_at_attitude(SQUARE, x, q, r + rng.normal(0, 0.1, 3), out)
        assert position_covariance(SQUARE, out, SIGMA, P)
        squares.append((out - r) @ np.linalg.solve(P, out - r))
    print(f"mean {np.mean(squares):.3f}")
    assert 2.75 < np.mean(squares) < 3.25


def test_the_position_found_is_a_minimum_of_the_cost(rng: np.random.Generator) -> None:
    out = np.empty(3)
    for _ in range(20):
        r, q, x = scene(rng, SIGMA)
        cost = position_at_attitude(SQUARE, x, q, r, out)
        R = Rotation.from_quat(np.roll(q, -1))

        def cost_at(p: Array, R: Rotation = R, x: Array = x) -> float:
            d = SQUARE - p
            return float(((R.apply(x) - d / np.linalg.norm(d, axis=1)[:, None]) ** 2).sum())

        assert cost == pytest.approx(cost_at(out), rel=1e-9)
        gradient = [(cost_at(out + e) - cost_at(out - e)) / 2e-6 for e in 1e-6 * np.eye(3)]
        np.testing.assert_allclose(gradient, 0.0, atol=1e-4)


def test_the_covariance_is_that_of_finite_differences(rng: np.random.Generator) -> None:
    P = np.empty((3, 3))
    r, _, _ = scene(rng, 0.0)

    def bearings(p: Array) -> Array:
        d = SQUARE - p
        return np.ravel(d / np.linalg.norm(d, axis=1)[:, None])

    J = np.stack([(bearings(r + e) - bearings(r - e)) / 2e-6 for e in 1e-6 * np.eye(3)], 1)
    assert position_covariance(SQUARE, r, SIGMA, P)
    np.testing.assert_allclose(P, SIGMA**2 * np.linalg.inv(J.T @ J), rtol=1e-6)


def test_what_determines_no_position_leaves_the_start(rng: np.random.Generator) -> None:
    r, q, x = scene(rng, 0.0)
    out, P = np.empty(3), np.full((3, 3), 7.0)
    for beacons, bearings in ((SQUARE, x * np.nan), (SQUARE[:1], x[:1]), (SQUARE[:0], x[:0])):
        assert math.isnan(position_at_attitude(beacons, bearings, q, r, out))
        np.testing.assert_array_equal(out, r)
    assert not position_covariance(SQUARE[:1], r, SIGMA, P)
    assert (P == 7.0).all()


def test_a_far_start_stays_bounded(rng: np.random.Generator) -> None:
    out = np.empty(3)
    for _ in range(50):
        _, q, x = scene(rng, SIGMA)
        position_at_attitude(SQUARE, x, q, rng.normal(0, 5, 3), out)
        assert np.linalg.norm(out) < 50.0
