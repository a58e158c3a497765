"""R_d and its rates."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from control.desired_attitude import attitude_of_force, axes_of_force
from quadrotor.rotations import hat, quaternion_from_matrix, yaw_of
from tests.support.arrays import Array


def desired(
    force: npt.ArrayLike, yaw: float, yaw_rate: float = 0.0, yaw_acceleration: float = 0.0
) -> tuple[Array, Array, Array]:
    force = np.asarray(force, dtype=float)
    if force.ndim == 1:
        force = np.vstack([force, np.zeros((2, 3))])
    f, f_dot, f_ddot = map(tuple, force)
    axes, w, w_dot = attitude_of_force(f, f_dot, f_ddot, yaw, yaw_rate, yaw_acceleration)
    np.testing.assert_allclose(axes_of_force(f, yaw), axes, atol=1e-15)
    return np.array(axes).T, np.array(w), np.array(w_dot)


def above_horizon(rng: np.random.Generator) -> Array:
    force = rng.normal(size=3) * 5.0
    force[2] = abs(force[2]) + 0.5
    return force


def test_a_vertical_force_gives_a_level_attitude() -> None:
    R, w, w_dot = desired([0.0, 0.0, 10.0], 0.0)
    np.testing.assert_allclose(R, np.eye(3), atol=1e-15)
    assert not w.any()
    assert not w_dot.any()


def test_it_is_a_rotation_with_z_along_the_force_and_exactly_the_yaw(
    rng: np.random.Generator,
) -> None:
    for _ in range(300):
        force, yaw = above_horizon(rng), rng.uniform(-3.1, 3.1)
        R, _, _ = desired(force, yaw)
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-13)
        assert np.linalg.det(R) == pytest.approx(1.0)
        np.testing.assert_allclose(R[:, 2], force / np.linalg.norm(force), atol=1e-14)
        assert yaw_of(quaternion_from_matrix(R)) == pytest.approx(yaw, abs=1e-9)


def test_turning_the_world_about_the_vertical_turns_the_attitude(rng: np.random.Generator) -> None:
    for _ in range(100):
        force, yaw, turn = above_horizon(rng), rng.uniform(-3, 3), rng.uniform(-3, 3)
        c, s = np.cos(turn), np.sin(turn)
        Z = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        np.testing.assert_allclose(
            desired(Z @ force, yaw + turn)[0], Z @ desired(force, yaw)[0], atol=1e-12
        )


def test_rates_are_the_derivatives_of_the_attitude(rng: np.random.Generator) -> None:
    h = 1e-4
    for _ in range(100):
        f0, f1, f2 = above_horizon(rng), rng.normal(size=3), rng.normal(size=3)
        yaw = rng.normal(size=3)

        def at(
            t: float, f0: Array = f0, f1: Array = f1, f2: Array = f2, yaw: Array = yaw
        ) -> tuple[Array, Array, Array]:
            force = [f0 + f1 * t + f2 * t * t / 2, f1 + f2 * t, f2]
            return desired(
                force, yaw[0] + yaw[1] * t + yaw[2] * t * t / 2, yaw[1] + yaw[2] * t, yaw[2]
            )

        (R_minus, w_minus, _), (R, w, w_dot), (R_plus, w_plus, _) = at(-h), at(0.0), at(h)
        R_dot = (R_plus - R_minus) / (2 * h)
        np.testing.assert_allclose(R.T @ R_dot, hat(w), atol=2e-5 * (1 + np.abs(w).max() ** 3))
        # The derivative of omega is from another formula: an independent check of R''.
        finite = (w_plus - w_minus) / (2 * h)
        np.testing.assert_allclose(w_dot, finite, atol=2e-5 * (1 + np.abs(finite).max() ** 2))


def test_the_length_of_the_force_does_not_matter(rng: np.random.Generator) -> None:
    f = rng.normal(size=(3, 3))
    f[0, 2] += 10.0
    for a, b in zip(desired(f, 0.3, 0.2, 0.1), desired(7.0 * f, 0.3, 0.2, 0.1), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)
