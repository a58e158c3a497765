"""Normal equations of the bearings, by finite differences, and their inverse."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimation.poses.bearing_frame import SIGHTS
from estimation.poses.bearing_refinement import normal_equations, refine, tilted
from quadrotor.records import Array

SQUARE = np.array([[1, 1, 0.1], [1, -1, 0.1], [-1, -1, 0.1], [-1, 1, 0.1]])


def frame_of(bearings: Array) -> Array:
    frame = np.zeros((SIGHTS + 4, 6))
    frame[SIGHTS:, :3], frame[SIGHTS:, 3:] = SQUARE, bearings
    return frame


def residuals(bearings: Array, r: Array, R: Rotation) -> Array:
    d = SQUARE - r
    return np.ravel(R.apply(bearings) - d / np.linalg.norm(d, axis=1)[:, None])


@pytest.mark.parametrize("angle", [0.0, 1e-8, 1.0])
def test_normal_equations_are_those_of_finite_differences(
    angle: float, rng: np.random.Generator
) -> None:
    r = rng.uniform(0.3, 1.2, 3)
    R = Rotation.from_rotvec(angle * rng.normal(size=3))
    d = SQUARE - r
    x = R.inv().apply(d / np.linalg.norm(d, axis=1)[:, None]) + 0.05 * rng.normal(size=(4, 3))
    x /= np.linalg.norm(x, axis=1)[:, None]
    columns = []
    for e in 1e-6 * np.eye(6):
        ahead = residuals(x, r + e[:3], Rotation.from_rotvec(e[3:]) * R)
        behind = residuals(x, r - e[:3], Rotation.from_rotvec(-e[3:]) * R)
        columns.append((ahead - behind) / 2e-6)
    J, e = np.stack(columns, 1), residuals(x, r, R)
    q = tuple(np.roll(R.as_quat(), 1).tolist())
    cost, distance, A, B, D, g_r, g_phi = normal_equations(frame_of(x), tuple(r.tolist()), q)
    assert cost == pytest.approx(e @ e)
    assert distance == pytest.approx(np.linalg.norm(d, axis=1).mean())
    np.testing.assert_allclose(np.r_[g_r, g_phi], J.T @ e, atol=1e-8)
    blocks = np.zeros((6, 6))
    for place, (diagonal, (xy, xz, yz)) in ((0, A), (3, D)):
        block = np.diag(diagonal) + np.array([[0, xy, xz], [xy, 0, yz], [xz, yz, 0]])
        blocks[place : place + 3, place : place + 3] = block
    blocks[:3, 3:], blocks[3:, :3] = np.array(B), np.array(B).T
    np.testing.assert_allclose(blocks, J.T @ J, atol=1e-8)
    frame = frame_of(x)
    seen, _, _, _ = refine(frame, tuple(r.tolist()), q, 1e-3, 0)
    assert seen
    np.testing.assert_allclose(frame[:6] @ blocks, np.eye(6), atol=1e-8)


@pytest.mark.parametrize("size", [0.0, 1e-8, 0.01])
def test_a_tilt_turns_about_world_axes(size: float, rng: np.random.Generator) -> None:
    R, phi = Rotation.random(rng=rng), size * rng.normal(size=3)
    got = tilted(tuple(np.roll(R.as_quat(), 1).tolist()), tuple(phi.tolist()))
    expected = Rotation.from_rotvec(phi) * R
    between = (Rotation.from_quat(np.roll(got, -1)) * expected.inv()).magnitude()
    assert between <= np.linalg.norm(phi) ** 3 / 10 + 1e-14
    assert np.linalg.norm(got) == pytest.approx(1.0, abs=1e-15)


def test_steps_are_clamped_and_never_raise_the_cost(rng: np.random.Generator) -> None:
    """The starts are metres and radians off."""
    for _ in range(50):
        x = rng.normal(size=(4, 3))
        x /= np.linalg.norm(x, axis=1)[:, None]
        r, q = rng.normal(0, 2, 3), rng.normal(size=4)
        q /= np.linalg.norm(q)
        before, distance = normal_equations(frame_of(x), tuple(r), tuple(q))[:2]
        for steps in (1, 5):
            _, cost, moved, _ = refine(frame_of(x), tuple(r), tuple(q), math.radians(1.5), steps)
            assert cost <= before + 1e-12
        _, _, moved, _ = refine(frame_of(x), tuple(r), tuple(q), math.radians(1.5), 1)
        assert np.linalg.norm(np.array(moved) - r) <= 0.5 * distance + 1e-9


def test_close_to_a_beacon_its_distance_is_not_taken_for_known(rng: np.random.Generator) -> None:
    """The nearest beacon is at 1 mm: with noise, its bearing hardly constrains the position."""
    r = SQUARE[0] + np.array([0.0, 0.0, 1e-3])
    R = Rotation.from_rotvec(rng.normal(size=3))
    d = SQUARE - r
    x = R.inv().apply(d / np.linalg.norm(d, axis=1)[:, None])
    q = tuple(np.roll(R.as_quat(), 1).tolist())
    deviations = []
    for sigma in (1e-9, math.radians(1.5)):
        frame = frame_of(x)
        assert refine(frame, tuple(r.tolist()), q, sigma, 0)[0]
        deviations.append(np.sqrt(np.linalg.eigvalsh(frame[:3, :3])))
    assert 0.5e-3 < deviations[0][0] < 2e-3  # m a rad: the distance itself
    assert deviations[1][0] > 0.05  # the effect of the distance's deviation
