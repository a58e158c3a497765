"""Eq. 5."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from control.attitude_law import attitude_error, attitude_torque
from control.parameters import ControlParameters, control_record
from quadrotor.rotations import rotation_exp
from tests.support.arrays import Array

J = np.array([0.0154, 0.0154, 0.0250])
GAINS = control_record(ControlParameters())
KR, KW, KF = np.array([60, 60, 12]), np.array([12, 12, 5]), np.array([10, 10, 2])


def vector(v: npt.ArrayLike) -> tuple[float, float, float]:
    x, y, z = np.asarray(v, dtype=float).tolist()
    return x, y, z


def torque(
    R: Array,
    w: Array,
    R_d: Array,
    w_d: npt.ArrayLike = (0, 0, 0),
    w_dot_d: npt.ArrayLike = (0, 0, 0),
    integral: npt.ArrayLike = (0, 0, 0),
) -> tuple[Array, Array]:
    axes, desired = ((vector(a[:, 0]), vector(a[:, 1]), vector(a[:, 2])) for a in (R, R_d))
    turning, wanted, change, total = map(vector, (w, w_d, w_dot_d, integral))
    e_R = attitude_error(axes, desired)
    u = attitude_torque(axes, turning, desired, wanted, change, e_R, total, GAINS[0], vector(J))
    return np.array(u), np.array(e_R)


def test_aligned_and_at_rest_asks_for_no_torque() -> None:
    u, e_R = torque(np.eye(3), np.zeros(3), np.eye(3))
    assert not u.any()
    assert not e_R.any()


def test_it_is_eq_5(rng: np.random.Generator) -> None:
    for _ in range(100):
        R, R_d = rotation_exp(rng.normal(size=3)), rotation_exp(rng.normal(size=3))
        w, w_d, w_dot_d, integral = rng.normal(size=(4, 3))
        E = R.T @ R_d
        S = 0.5 * (E - E.T)
        e_R = np.array([S[2, 1], S[0, 2], S[1, 0]])
        expected = (
            J * (KR * e_R + KF * integral + KW * (E @ w_d - w))
            + np.cross(w, J * w)
            + J * (E @ w_dot_d - np.cross(w, E @ w_d))
        )
        u, e = torque(R, w, R_d, w_d, w_dot_d, integral)
        np.testing.assert_allclose(e, e_R, atol=1e-14)
        np.testing.assert_allclose(u, expected, atol=1e-13)


def test_a_small_error_is_answered_towards_the_desired_attitude(rng: np.random.Generator) -> None:
    for size in (1e-8, 1e-3):
        R, phi = rotation_exp(rng.normal(size=3)), rng.normal(size=3) * size
        u, e_R = torque(R, np.zeros(3), R @ rotation_exp(phi))
        np.testing.assert_allclose(e_R, phi, rtol=1e-5, atol=1e-15)
        np.testing.assert_allclose(u, J * KR * e_R, rtol=1e-12)


def test_on_the_desired_motion_the_torque_is_eulers_equation(rng: np.random.Generator) -> None:
    # Without an error, the acceleration must be the desired one: J w' + w x J w = u.
    R = rotation_exp(rng.normal(size=3))
    w, w_dot = rng.normal(size=3), rng.normal(size=3)
    u, _ = torque(R, w, R, w, w_dot)
    np.testing.assert_allclose(u, J * w_dot + np.cross(w, J * w), atol=1e-14)


def test_turning_the_world_changes_nothing(rng: np.random.Generator) -> None:
    R, R_d, Q = (rotation_exp(v) for v in rng.normal(size=(3, 3)))
    w, w_d, w_dot = rng.normal(size=(3, 3))
    np.testing.assert_allclose(
        torque(Q @ R, w, Q @ R_d, w_d, w_dot)[0], torque(R, w, R_d, w_d, w_dot)[0], atol=1e-12
    )
