"""Arithmetic of tuples agrees with numpy and quadrotor.rotations."""

from __future__ import annotations

import numpy as np
import pytest

from quadrotor import rotations, vectors


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    seed = sum(map(ord, request.node.name))
    print("seed", seed)
    return np.random.default_rng(seed)


def test_vector_arithmetic_is_that_of_numpy(rng: np.random.Generator) -> None:
    for _ in range(20):
        a, b = rng.normal(size=3), rng.normal(size=3)
        s = float(rng.normal())
        u, v = vectors.vector(a), vectors.vector(b)
        assert vectors.add(u, v) == tuple(a + b)
        assert vectors.subtract(u, v) == tuple(a - b)
        assert vectors.scale(s, u) == tuple(s * a)
        assert vectors.times(u, v) == tuple(a * b)
        np.testing.assert_allclose(vectors.along(u, s, v), a + s * b, rtol=1e-14)
        np.testing.assert_allclose(vectors.dot(u, v), a @ b, rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(vectors.cross(u, v), np.cross(a, b), rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(vectors.length(u), np.linalg.norm(a), rtol=1e-14)
        out = np.zeros(3)
        vectors.store(u, out)
        assert (out == a).all()


@pytest.mark.parametrize("angle", [0.0, 1e-8, 1.0, 3.1])
def test_quaternions_are_those_of_rotations(rng: np.random.Generator, angle: float) -> None:
    p = rotations.quaternion_normalize(rng.normal(size=4))
    phi = rng.normal(size=3)
    phi *= angle / np.linalg.norm(phi)
    v = rng.normal(size=3)
    q = vectors.turned(vectors.quaternion(p), vectors.vector(phi))
    expected = rotations.quaternion_multiply(p, rotations.quaternion_exp(phi))
    np.testing.assert_allclose(q, expected, atol=1e-15)
    R = rotations.quaternion_to_matrix(expected)
    axes = vectors.axes_of(q)
    np.testing.assert_allclose(np.array(axes).T, R, atol=1e-15)
    np.testing.assert_allclose(vectors.to_world(axes, vectors.vector(v)), R @ v, atol=1e-14)
    np.testing.assert_allclose(vectors.to_body(axes, vectors.vector(v)), R.T @ v, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(vectors.normalized((3.0, 4.0, 0.0, 12.0))), 1.0)
