"""Shapes from desired bearings, and bearings that contradict each other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from extensions.formations.mathematics.realisation import (
    contradicting_edges,
    desired_places,
    realise,
)
from extensions.formations.mathematics.rigidity import (
    bearings,
    mean_distance,
    missing_edges,
    yaw_rotation,
)
from extensions.formations.tests.mathematics.kinematic import complete, scattered
from quadrotor.errors import DegenerateGeometryError


def test_a_rigid_formation_is_found_from_its_bearings() -> None:
    rng = np.random.default_rng(1)
    for n in (3, 4, 5, 6, 8):
        p, yaws = scattered(rng, n), rng.uniform(-math.pi, math.pi, n)
        edges = complete(n)[rng.uniform(size=n * (n - 1)) < 0.7]
        added = missing_edges(p, yaws, edges)
        edges = np.array([*edges.tolist(), *added])
        q, found, residual = realise(bearings(p, yaws, edges), edges, n)
        assert residual < 1e-7
        np.testing.assert_allclose(q[0], 0.0, atol=1e-12)
        assert mean_distance(q) == pytest.approx(1.0)
        every = complete(n)  # also bearings that were not given
        np.testing.assert_allclose(bearings(q, found, every), bearings(p, yaws, every), atol=1e-5)


def test_a_turned_bearing_is_found() -> None:
    rng = np.random.default_rng(2)
    p, yaws, edges = scattered(rng, 4), rng.uniform(-3, 3, 4), complete(4)
    wanted = bearings(p, yaws, edges)
    assert contradicting_edges(wanted, edges, 4) == ()
    wanted[5] = yaw_rotation(math.radians(20.0)) @ wanted[5]
    assert realise(wanted, edges, 4)[2] > math.radians(1.0)
    assert contradicting_edges(wanted, edges, 4) == (tuple(edges[5].tolist()),)
    with pytest.raises(DegenerateGeometryError, match=r"contradict each other .* \(1, 3\)"):
        desired_places(wanted, edges, 4)


def test_places_are_of_the_own_yaw_frame() -> None:
    rng = np.random.default_rng(3)
    p, yaws, edges = scattered(rng, 5), rng.uniform(-3, 3, 5), complete(5)
    places, turns = desired_places(bearings(p, yaws, edges), edges, 5)
    for k in range(5):
        own = yaw_rotation(-yaws[k]) @ (p[k] - p.mean(axis=0)) / mean_distance(p)
        np.testing.assert_allclose(places[k], own, atol=1e-6)
    np.testing.assert_allclose(np.sin(turns - (yaws - yaws[0])), 0.0, atol=1e-6)


def test_what_is_no_desired_formation_is_told() -> None:
    edges = [(0, 1), (1, 0)]
    x = [1.0, 0.0, 0.0]
    with pytest.raises(DegenerateGeometryError, match=r"edge \(0, 1\) has the length 2"):
        realise([[2.0, 0.0, 0.0], x], edges, 2)
    with pytest.raises(DegenerateGeometryError, match=r"edge \(0, 1\) is there twice"):
        realise([x, x], [(0, 1), (0, 1)], 2)
    with pytest.raises(DegenerateGeometryError, match="of no two vehicles"):
        realise([x], [(0, 2)], 2)
    with pytest.raises(DegenerateGeometryError, match="1 bearings are desired of 2 edges"):
        realise([x], edges, 2)
    with pytest.raises(DegenerateGeometryError, match="do not determine a shape"):
        desired_places([x], [(0, 1)], 2)
