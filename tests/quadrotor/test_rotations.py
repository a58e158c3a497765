"""Rotations, in three regimes: identity, 1e-8 near it, anywhere."""

from __future__ import annotations

import numpy as np
import pytest

from quadrotor import rotations as r
from tests.support.arrays import Array

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def vectors(name: str) -> list[Array]:
    """Return the zero vector, tiny ones about the series' switch, and any up to half a turn."""
    seed = sum(name.encode())
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    out = [np.zeros(3)]
    for size in (1e-12, 1e-8, 0.999e-6, 1.001e-6, 1e-3):
        direction = rng.normal(size=3)
        out.append(size * direction / np.linalg.norm(direction))
    for _ in range(50):
        direction = rng.normal(size=3)
        out.append(rng.uniform(0.0, np.pi - 1e-3) * direction / np.linalg.norm(direction))
    return out


def quaternions(name: str) -> list[Array]:
    return [r.quaternion_exp(v) for v in vectors(name)]


def test_hat_is_the_cross_product() -> None:
    for v in vectors("hat"):
        u = np.array([0.3, -0.7, 1.1])
        np.testing.assert_allclose(r.hat(v) @ u, np.cross(v, u), atol=1e-15)
        np.testing.assert_allclose(r.cross(v, u), np.cross(v, u), atol=1e-15)


def test_exp_and_log_undo_each_other() -> None:
    for v in vectors("exp"):
        np.testing.assert_allclose(r.quaternion_log(r.quaternion_exp(v)), v, rtol=1e-9, atol=1e-16)
        np.testing.assert_allclose(r.rotation_log(r.rotation_exp(v)), v, rtol=1e-6, atol=1e-9)


def test_exp_is_the_matrix_exponential() -> None:
    for v in vectors("series"):
        K, total, term = r.hat(v), np.eye(3), np.eye(3)
        for k in range(1, 40):
            term = term @ K / k
            total = total + term
        np.testing.assert_allclose(r.rotation_exp(v), total, atol=1e-13)


def test_log_is_short_and_blind_to_the_sign_of_the_quaternion() -> None:
    for q in quaternions("sign"):
        assert np.linalg.norm(r.quaternion_log(q)) <= np.pi + 1e-12
        np.testing.assert_allclose(r.quaternion_log(-q), r.quaternion_log(q), atol=1e-15)


def test_the_product_of_quaternions_is_that_of_their_matrices() -> None:
    qs = quaternions("product")
    for p, q in zip(qs, reversed(qs), strict=True):
        product = r.quaternion_multiply(p, q)
        assert np.linalg.norm(product) == pytest.approx(1.0)
        np.testing.assert_allclose(
            r.quaternion_to_matrix(product),
            r.quaternion_to_matrix(p) @ r.quaternion_to_matrix(q),
            atol=1e-14,
        )


def test_quaternions_are_a_group() -> None:
    for q in quaternions("group"):
        np.testing.assert_array_equal(r.quaternion_multiply(q, IDENTITY), q)
        np.testing.assert_array_equal(r.quaternion_multiply(IDENTITY, q), q)
        inverse = r.quaternion_conjugate(q)
        np.testing.assert_allclose(r.quaternion_multiply(q, inverse), IDENTITY, atol=1e-15)


def test_a_matrix_and_its_quaternion_are_the_same_rotation() -> None:
    # Half turns about each axis and between reach every pivot of the inverse.
    axes = [*np.eye(3), np.array([1.0, 1.0, 0.0]), np.array([1.0, 2.0, 3.0])]
    halves = [np.pi * a / np.linalg.norm(a) for a in axes]
    for q in quaternions("matrix") + [r.quaternion_exp(v) for v in halves]:
        R = r.quaternion_to_matrix(q)
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-14)
        assert np.linalg.det(R) == pytest.approx(1.0)
        back = r.quaternion_from_matrix(R)
        assert back[0] >= 0.0
        np.testing.assert_allclose(r.quaternion_to_matrix(back), R, atol=1e-14)


def test_rotate_is_the_matrix_times_the_vector() -> None:
    v = np.array([0.3, -0.7, 1.1])
    for q in quaternions("rotate"):
        R = r.quaternion_to_matrix(q)
        np.testing.assert_allclose(r.rotate(q, v), R @ v, atol=1e-14)
        np.testing.assert_allclose(r.rotate_inverse(q, v), R.T @ v, atol=1e-14)


def test_a_quarter_turn_left_takes_forward_to_left() -> None:
    # This fixes the order (w, x, y, z) and the direction body to world.
    q = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    np.testing.assert_allclose(r.rotate(q, np.array([1.0, 0.0, 0.0])), [0, 1, 0], atol=1e-15)
    assert r.yaw_of(q) == pytest.approx(np.pi / 2)
    nose_down = r.quaternion_from_euler(0.0, 0.3, 0.0)
    assert r.rotate(nose_down, np.array([1.0, 0.0, 0.0]))[2] < 0


def test_euler_angles_are_zyx_and_come_back() -> None:
    rng = np.random.default_rng(7)
    print("seed 7")
    for _ in range(100):
        roll, pitch, yaw = rng.uniform([-3.1, -1.5, -3.1], [3.1, 1.5, 3.1])
        q = r.quaternion_from_euler(roll, pitch, yaw)
        np.testing.assert_allclose(r.euler_from_quaternion(q), [roll, pitch, yaw], atol=1e-9)
        x, y, z = np.eye(3)
        expected = r.rotation_exp(yaw * z) @ r.rotation_exp(pitch * y) @ r.rotation_exp(roll * x)
        np.testing.assert_allclose(r.quaternion_to_matrix(q), expected, atol=1e-14)


def test_euler_angles_stay_finite_at_the_poles() -> None:
    for pitch in (np.pi / 2, -np.pi / 2):
        angles = r.euler_from_quaternion(r.quaternion_from_euler(0.3, pitch, 0.2))
        assert np.isfinite(angles).all()
        assert angles[1] == pytest.approx(pitch, abs=1e-7)


def test_normalize_keeps_the_direction() -> None:
    q = r.quaternion_normalize(np.array([3.0, 0.0, 4.0, 0.0]))
    np.testing.assert_allclose(q, [0.6, 0.0, 0.8, 0.0])


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [
        (0.0, 0.0),
        (3.0, 3.0),
        (4.0, 4.0 - 2 * np.pi),
        (-4.0, 2 * np.pi - 4.0),
        (20.0, 20 - 6 * np.pi),
    ],
)
def test_angles_are_wrapped_into_a_turn(angle: float, wrapped: float) -> None:
    assert r.wrap_angle(angle) == pytest.approx(wrapped)
