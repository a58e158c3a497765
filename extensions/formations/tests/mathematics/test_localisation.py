"""The network's filter against its bound, and what it does with bearings that do not fit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.estimation.network_localisation import Case, squares
from extensions.formations.mathematics.localisation import MotionNoise, NetworkFilter
from extensions.formations.mathematics.network_bound import cramer_rao, relative
from extensions.formations.mathematics.rigidity import (
    bearings,
    mean_distance,
    null_motions,
    rigidity_matrix,
    yaw_rotation,
)
from extensions.formations.tests.mathematics.kinematic import SIGMA, complete, scattered
from quadrotor.errors import DegenerateGeometryError
from quadrotor.records import Array


def seen_from_first(p: Array, yaws: Array) -> tuple[Array, Array]:
    turns = yaws - yaws[0]
    return (p - p[0]) @ yaw_rotation(yaws[0]), np.arctan2(np.sin(turns), np.cos(turns))


def test_the_error_is_that_of_the_bound() -> None:
    """The ratio is at most 1.1, with 10 % for the scatter of 40 formations."""
    ratio = math.sqrt(float(squares(Case(3, 15, moving=True, ranged=False), 40).mean()))
    assert ratio < 1.1 * 1.1


def test_motions_tell_the_scale_only_if_they_are_to() -> None:
    rng = np.random.default_rng(7)
    p, yaws, edges = scattered(rng, 3), rng.uniform(-3, 3, 3), complete(3)
    sigmas = {}
    for tells in (True, False):
        flown = NetworkFilter.from_bearings(
            0, 3, bearings(p, yaws, edges), edges, SIGMA, 2.0, 0.3, MotionNoise(tells_scale=tells)
        )
        for _ in range(30):
            motions = {j: (np.array([0.5, 0.3 * j, 0.0]), 0.2 * j) for j in range(3)}
            flown.predict(motions, 1.0 / 30.0)
            expected = bearings(flown.positions_y, flown.yaws, edges)
            flown.bearings(edges, expected, SIGMA)
        places = np.pad(flown.positions_y[1:], ((0, 0), (0, 1))).ravel()
        sigmas[tells] = 1.0 / math.sqrt(places @ np.linalg.inv(flown.covariance) @ places)
    assert sigmas[True] < 0.2
    assert sigmas[False] == pytest.approx(0.3, rel=0.02)


def test_one_bearing_of_two_vehicles_begins_no_filter() -> None:
    with pytest.raises(DegenerateGeometryError, match="do not determine the shape"):
        NetworkFilter.from_bearings(0, 2, [(1.0, 0.0, 0.0)], [(0, 1)], SIGMA)


def test_the_bound_of_frames_at_rest_is_the_filters_covariance() -> None:
    rng = np.random.default_rng(1)
    p, yaws, edges = scattered(rng, 4), rng.uniform(-3, 3, 4), complete(4)
    exact = bearings(p, yaws, edges)
    flown = NetworkFilter.from_bearings(
        0, 4, exact, edges, SIGMA, mean_distance(p), noise=MotionNoise(0.0, 0.0)
    )
    for _ in range(9):
        flown.bearings(edges, exact, SIGMA)
        flown.distance(2, 3, float(np.linalg.norm(p[2] - p[3])), 0.1)
    places, turns, covariance = flown.estimate
    expected, yaw = seen_from_first(p, yaws)
    np.testing.assert_allclose(places, expected, atol=1e-6)
    np.testing.assert_allclose(turns, yaw, atol=1e-6)
    # Ten frames of bearings, nine distances; the guessed scale adds next to nothing.
    T = relative(p, yaws, 0)
    bound = T @ cramer_rao(p, yaws, edges, SIGMA / math.sqrt(10), [(2, 3)], 0.1 / 3.0) @ T.T
    np.testing.assert_allclose(np.diag(covariance), np.diag(bound), rtol=0.03)


def test_bearings_never_tell_the_scale() -> None:
    rng = np.random.default_rng(2)
    p, yaws, edges = scattered(rng, 5), rng.uniform(-3, 3, 5), complete(5)
    exact = bearings(p, yaws, edges)

    def noisy() -> Array:
        measured = exact + SIGMA * rng.normal(size=exact.shape)
        return np.asarray(measured / np.linalg.norm(measured, axis=1, keepdims=True))

    still = MotionNoise(0.0, 0.0, 0.0, 0.0)
    flown = NetworkFilter.from_bearings(1, 5, noisy(), edges, SIGMA, 2.0, 0.3, still)

    def scale_sigma() -> float:
        places = np.pad(np.delete(flown.positions_y, 1, axis=0), ((0, 0), (0, 1))).ravel()
        information = places @ np.linalg.inv(flown.covariance) @ places
        return float(1.0 / math.sqrt(information))

    for _ in range(100):
        flown.bearings(edges, noisy(), SIGMA)
    assert scale_sigma() == pytest.approx(0.3, rel=1e-4)


def test_known_motion_carries_the_estimate_along_and_tells_the_scale() -> None:
    rng = np.random.default_rng(3)
    p, yaws, edges = scattered(rng, 4), rng.uniform(-3, 3, 4), complete(4)
    flown = NetworkFilter.from_bearings(
        0, 4, bearings(p, yaws, edges), edges, SIGMA, 1.2 * mean_distance(p)
    )
    v, w = rng.normal(size=(4, 3)) * 0.5, rng.normal(size=4) * 0.5
    dt = 1.0 / 30.0
    for _ in range(240):
        p = p + dt * np.einsum("kab,kb->ka", yaw_rotation(yaws + 0.5 * dt * w), v)
        yaws = yaws + dt * w
        flown.predict({k: (v[k], float(w[k])) for k in range(4)}, dt)
        flown.bearings(edges, bearings(p, yaws, edges), SIGMA)
    expected, turns = seen_from_first(p, yaws)
    np.testing.assert_allclose(flown.positions_y, expected, atol=0.02 * mean_distance(p))
    np.testing.assert_allclose(np.sin(flown.yaws - turns), 0.0, atol=0.01)


def test_swapped_identities_are_refused_by_name() -> None:
    rng = np.random.default_rng(4)
    p, yaws, edges = scattered(rng, 4), rng.uniform(-3, 3, 4), complete(4)
    exact = bearings(p, yaws, edges)
    flown = NetworkFilter.from_bearings(0, 4, exact, edges, SIGMA)
    for _ in range(5):
        flown.bearings(edges, exact, SIGMA)
    before = flown.positions_y.copy()
    swapped = exact.copy()
    swapped[[0, 1]] = exact[[1, 0]]  # vehicle 0 takes 1 for 2
    for _ in range(5):
        assert flown.bearings(edges, swapped, SIGMA) == len(edges) - 2
    assert flown.refused == {(0, 1): 5, (0, 2): 5}
    np.testing.assert_allclose(flown.positions_y, before, atol=1e-6)
    assert flown.bearings([(0, 1)], exact[:1], SIGMA) == 1


def test_the_bound_is_across_the_null_motions() -> None:
    rng = np.random.default_rng(5)
    p, yaws, edges = scattered(rng, 4), rng.uniform(-3, 3, 4), complete(4)
    C = cramer_rao(p, yaws, edges, SIGMA)
    np.testing.assert_allclose(C @ null_motions(p, yaws), 0.0, atol=1e-12)
    B = rigidity_matrix(p, yaws, edges)
    np.testing.assert_allclose(C, np.linalg.pinv(B.T @ B / SIGMA**2, rcond=1e-10), atol=1e-10)
    np.testing.assert_allclose(
        relative(p, yaws, 2) @ null_motions(p, yaws)[:, [0, 1, 2, 4]], 0.0, atol=1e-12
    )


def test_a_formation_that_is_not_rigid_has_no_bound_and_no_start() -> None:
    rng = np.random.default_rng(6)
    p, yaws, edges = scattered(rng, 4), rng.uniform(-3, 3, 4), complete(4)[:6]
    with pytest.raises(DegenerateGeometryError, match="not rigid"):
        cramer_rao(p, yaws, edges, SIGMA)
    with pytest.raises(DegenerateGeometryError, match="wait for one with more edges"):
        NetworkFilter.from_bearings(0, 4, bearings(p, yaws, edges), edges, SIGMA)
    edges = complete(4)
    flown = NetworkFilter.from_bearings(0, 4, bearings(p, yaws, edges), edges, SIGMA)
    with pytest.raises(DegenerateGeometryError, match="the distance of vehicles 0 and 1 is 0"):
        flown.distance(0, 1, 0.0, 0.1)
