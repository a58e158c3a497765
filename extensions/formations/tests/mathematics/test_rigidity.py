"""The rigidity matrix against derivatives, and what it says of known formations."""

from __future__ import annotations

import math

import numpy as np
import pytest

from extensions.formations.mathematics.rigidity import (
    NULL_MOTIONS,
    Edges,
    bearings,
    is_rigid,
    missing_edges,
    null_motions,
    rigidity_eigenvalue,
    rigidity_matrix,
)
from extensions.formations.tests.mathematics.kinematic import complete, scattered
from quadrotor.errors import DegenerateGeometryError
from quadrotor.records import Array

PAIR = [(0, 1), (1, 0)]


def formation(rng: np.random.Generator) -> tuple[Array, Array, Edges]:
    n = int(rng.integers(3, 9))
    some = complete(n)
    return (
        rng.normal(size=(n, 3)) * 2.0,
        rng.uniform(-math.pi, math.pi, n),
        some[rng.uniform(size=len(some)) < 0.6],
    )


def by_complex_step(p: Array, yaws: Array, edges: Edges) -> Array:
    """Return the derivative of the bearings, which are written out here once more."""
    n, h = len(yaws), 1e-30
    x = np.tile(np.column_stack([p, yaws]).astype(complex), (4 * n, 1, 1))
    x.reshape(4 * n, 4 * n)[range(4 * n), range(4 * n)] += 1j * h
    i, j = edges.T
    z = x[:, j, :3] - x[:, i, :3]
    z = z / np.sqrt((z * z).sum(axis=-1, keepdims=True))
    c, s = np.cos(x[:, i, 3]), np.sin(x[:, i, 3])
    turned = (c * z[..., 0] + s * z[..., 1], c * z[..., 1] - s * z[..., 0], z[..., 2])
    return np.asarray(np.stack(turned, axis=-1).reshape(4 * n, -1).T.imag / h)


def test_the_matrix_is_the_derivative_of_the_bearings() -> None:
    rng = np.random.default_rng(1)
    worst = 0.0
    for _ in range(1000):
        p, yaws, edges = formation(rng)
        difference = rigidity_matrix(p, yaws, edges) - by_complex_step(p, yaws, edges)
        worst = max(worst, np.abs(difference).max(initial=0.0))
    assert worst < 1e-9


def test_bearings_do_not_see_the_five_null_motions() -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        p, yaws, edges = formation(rng)
        N = null_motions(p, yaws)
        assert np.linalg.matrix_rank(N) == NULL_MOTIONS
        np.testing.assert_allclose(rigidity_matrix(p, yaws, edges) @ N, 0.0, atol=1e-12)


def test_the_eigenvalue_depends_on_the_shape_alone() -> None:
    rng = np.random.default_rng(3)
    p, yaws, edges = scattered(rng, 5), rng.uniform(-3, 3, 5), complete(5)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    same = rigidity_eigenvalue(7.0 * p @ turn.T + 3.0, yaws + math.pi / 2, edges)
    assert rigidity_eigenvalue(p, yaws, edges) == pytest.approx(same, rel=1e-9)
    assert rigidity_eigenvalue(p, yaws, edges[:5]) == 0.0


def test_two_vehicles_are_rigid_when_they_see_each_other_and_are_not_one_above_the_other() -> None:
    assert is_rigid([[0, 0, 0], [2, 0, 1]], [0.3, 1.0], PAIR)
    assert not is_rigid([[0, 0, 0], [2, 0, 1]], [0.3, 1.0], PAIR[:1])
    assert not is_rigid([[0, 0, 0], [0, 0, 1]], [0.3, 1.0], PAIR)


def test_missing_edges_make_the_formation_rigid_and_none_is_too_many() -> None:
    rng = np.random.default_rng(4)
    for _ in range(20):
        p, yaws, edges = formation(rng)
        edges = edges[::3]
        added = missing_edges(p, yaws, edges)
        present = [(int(i), int(j)) for i, j in edges]
        assert is_rigid(p, yaws, [*present, *added])
        assert not set(added) & set(present)
        for edge in added:
            assert not is_rigid(p, yaws, [*present, *(one for one in added if one != edge)])
    assert missing_edges([[0, 0, 0], [2, 0, 1]], [0.0, 0.0], [(0, 1)]) == ((1, 0),)
    assert missing_edges([[0, 0, 0], [2, 0, 1]], [0.0, 0.0], PAIR) == ()


@pytest.mark.parametrize(
    ("positions", "edges", "told"),
    [
        ([[0, 0, 0], [0, 0, 0]], PAIR, "vehicles 0 and 1 are at one place"),
        ([[0, 0, 0], [1, 0, 0]], [(0, 2)], r"edge \(0, 2\) names a vehicle that is not there"),
        ([[0, 0, 0], [1, 0, 0]], [(1, 1)], "of a vehicle to itself"),
        ([[0, 0, 0], [1, 0, math.nan]], PAIR, "not finite"),
        ([0, 0, 0], PAIR, "shape"),
    ],
)
def test_what_has_no_bearings_is_told(positions: object, edges: object, told: str) -> None:
    with pytest.raises(DegenerateGeometryError, match=told):
        bearings(positions, [0.0, 0.0], edges)  # type: ignore[arg-type]


def test_vehicles_in_one_line_have_no_edges_that_help() -> None:
    with pytest.raises(DegenerateGeometryError, match="no bearings make these 3 vehicles"):
        missing_edges([[0, 0, 0], [1, 0, 1], [2, 0, 2]], [0.0, 0.0, 0.0], [(0, 1)])
