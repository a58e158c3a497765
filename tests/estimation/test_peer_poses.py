"""Poses for comparison: the paper's own method, and OpenCV's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.estimation.literal_pose import literal_pose
from benchmarks.estimation.opencv_pose import OpenCVPose
from quadrotor.errors import DegenerateGeometryError
from quadrotor.records import Array

SQUARE = np.array([[1, 1, 0.1], [1, -1, 0.1], [-1, -1, 0.1], [-1, 1, 0.1]])
UP = np.array([0.0, 0.0, 1.0])


def seen_from(r: Array, R: Rotation) -> Array:
    d = SQUARE - r
    return np.asarray(R.inv().apply(d / np.linalg.norm(d, axis=1)[:, None]))


def test_print_is_exact_without_noise(rng: np.random.Generator) -> None:
    for _ in range(20):
        r, R = rng.uniform(0.3, 1.2, 3), Rotation.from_rotvec(0.3 * rng.normal(size=3))
        position, R_wb = literal_pose(SQUARE, seen_from(r, R), UP, 0.1)
        np.testing.assert_allclose(position, r, atol=1e-9)
        np.testing.assert_allclose(R_wb, R.as_matrix(), atol=1e-9)


def test_print_divides_by_the_distance_of_the_origin() -> None:
    with pytest.raises(DegenerateGeometryError, match="d = 0"):
        literal_pose(SQUARE - [0, 0, 0.1], SQUARE, UP, 0.0)


def test_print_refuses_equal_bearings() -> None:
    with pytest.raises(DegenerateGeometryError, match="homography"):
        literal_pose(SQUARE, np.tile([0.0, 0.0, -1.0], (4, 1)), UP, 0.1)


@pytest.mark.parametrize("method", ["SQPNP", "IPPE"])
@pytest.mark.parametrize("polish", ["", "LM", "VVS"])
@pytest.mark.parametrize("aimed", [False, True])
def test_opencv_is_exact_without_noise(
    method: str, polish: str, aimed: bool, rng: np.random.Generator
) -> None:
    solver = OpenCVPose(SQUARE, method, polish, aimed)
    for _ in range(5):
        r = np.array([*rng.uniform(-0.4, 0.4, 2), rng.uniform(1.0, 2.0)])
        R = Rotation.from_euler("ZYX", [rng.uniform(-3, 3), 0.1, -0.2])
        position, R_wb = solver.solve(seen_from(r, R))
        np.testing.assert_allclose(position, r, atol=1e-4)
        np.testing.assert_allclose(R_wb, R.as_matrix(), atol=1e-4)


def test_opencv_cannot_take_a_bearing_beyond_90_degrees() -> None:
    solver = OpenCVPose(SQUARE, "SQPNP")
    x = seen_from(np.array([1.2, 1.2, 0.3]), Rotation.from_euler("ZYX", [0.0, -0.35, 0.35]))
    assert math.acos(-x[:, 2].max()) > math.pi / 2
    with pytest.raises(DegenerateGeometryError, match="90 degrees"):
        solver.solve(x)
