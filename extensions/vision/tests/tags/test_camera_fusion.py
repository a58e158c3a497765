"""Poses of several cameras are fused to one that is better than each, and disagreement is told."""

from __future__ import annotations

import numpy as np
import pytest

from extensions.vision.tags.camera_fusion import BodyPose, CameraFusion
from quadrotor.records import Array
from quadrotor.rotations import (
    quaternion_from_matrix,
    quaternion_to_matrix,
    rotation_exp,
    rotation_log,
)

RATE, SECONDS = 30.0, 6
NOISES = (
    np.array([0.006, 0.0008, 0.0008, 0.004, 0.004, 0.004]),  # sees badly along x
    np.array([0.001, 0.009, 0.001, 0.006, 0.006, 0.006]),  # and along y
)
"""Deviations of two cameras, m in world axes and rad in body axes."""


def true_pose(t: float) -> tuple[Array, Array]:
    """Return position and R_wb on a figure 8, with accelerations of up to 3 m/s²."""
    place = np.array([np.sin(1.2 * t), 0.5 * np.sin(2.4 * t), 1.0 + 0.2 * np.sin(t)])
    return place, rotation_exp(np.array([0.25 * np.sin(2.4 * t), 0.15 * np.sin(1.2 * t), 0.3 * t]))


def seen(t: float, camera: int, random: np.random.Generator, off: Array | None = None) -> BodyPose:
    place, R = true_pose(t)
    error = NOISES[camera] * random.standard_normal(6) + (0.0 if off is None else off)
    R = R @ rotation_exp(error[3:])
    return BodyPose(place + error[:3], quaternion_from_matrix(R), np.diag(NOISES[camera] ** 2))


def errors_of(pose: BodyPose, t: float) -> tuple[float, float]:
    place, R = true_pose(t)
    turn = rotation_log(R.T @ quaternion_to_matrix(pose.quaternion_wb))
    return float(np.sum((pose.position_w - place) ** 2)), float(turn @ turn)


def rms(squares: list[tuple[float, float]]) -> Array:
    return np.asarray(np.sqrt(np.mean(squares, axis=0)))


@pytest.mark.parametrize("apart", [0.0, 0.3, 0.5], ids=["together", "third", "half"])
def test_two_cameras_are_better_than_the_better_one_whenever_they_expose(apart: float) -> None:
    random, fusion = np.random.default_rng(7), CameraFusion(2)
    alone: list[list[tuple[float, float]]] = [[], []]
    fused = []
    for k in range(int(SECONDS * RATE)):
        for camera in (0, 1):
            t = (k + apart * camera) / RATE
            pose = seen(t, camera, random)
            alone[camera].append(errors_of(pose, t))
            found = fusion.take(camera, round(1e9 * t), pose)
            assert found is not None
            fused.append(errors_of(found, t))
    best = np.min([rms(one) for one in alone], axis=0)
    place, turn = rms(fused)
    assert place < 0.5 * best[0]
    assert turn < 1.1 * best[1]  # poses of the worse camera's pictures included
    assert not fusion.disagreements()


def test_the_errors_of_the_fused_pose_are_within_its_covariance() -> None:
    random, fusion, off = np.random.default_rng(3), CameraFusion(2), []
    for k in range(400):
        t = k / RATE
        fusion.take(0, round(1e9 * t), seen(t, 0, random))
        found = fusion.take(1, round(1e9 * t) + 1, seen(t, 1, random))
        if k > 2 and found is not None:
            error = found.position_w - true_pose(t)[0]
            off.append(error @ np.linalg.solve(found.covariance[:3, :3], error))
    assert 0.3 < np.mean(off) < 3.5  # 3 without the uncertainty of the cameras' own places


def test_one_camera_goes_on_alone_when_the_other_is_covered() -> None:
    random, fusion = np.random.default_rng(1), CameraFusion(2)
    for k in range(200):
        t, camera = k / RATE / 2, k % 2
        if camera and k > 100:
            continue
        pose = seen(t, camera, random)
        found = fusion.take(camera, round(1e9 * t), pose)
        assert found is not None
        if k > 110:
            np.testing.assert_allclose(found.position_w, pose.position_w, atol=1e-12)


def test_cameras_that_are_some_centimetres_or_degrees_off_are_told_by_how_much() -> None:
    for off, apart, turned in (
        ([0.03, 0.0, 0.04, 0.0, 0.0, 0.0], 0.05, 0.0),
        ([0.0, 0.0, 0.0, 0.0, 0.06, 0.0], 0.0, 0.06),
    ):
        random, fusion = np.random.default_rng(2), CameraFusion(3)
        for k in range(180):
            t, camera = k / RATE / 2, k % 2
            pose = seen(t, camera, random, np.array(off) if camera else None)
            assert fusion.take(camera, round(1e9 * t), pose) is not None, "still used"
        (told,) = fusion.disagreements()
        assert told.cameras == (0, 1)
        assert told.apart == pytest.approx(apart, abs=0.01)
        assert told.turned == pytest.approx(turned, abs=0.01)


@pytest.mark.parametrize("rate", [RATE, 7.0])
def test_a_camera_that_is_knocked_is_left_out_until_it_is_back(rate: float) -> None:
    random, fusion, out = np.random.default_rng(4), CameraFusion(2), []
    for k in range(360):
        t, camera = k / rate / 2, k % 2
        knocked = camera == 1 and 120 <= k < 240
        off = np.array([0.5, 0.0, 0.2, 0.0, 0.0, 0.3])
        pose = seen(t, camera, random, off if knocked else None)
        found = fusion.take(camera, round(1e9 * t), pose)
        if found is None:
            out.append(k)
            continue
        assert errors_of(found, t)[0] < 0.05**2
    assert len(out) >= 59
    assert all(120 <= k < 246 for k in out)


def test_a_body_that_is_carried_elsewhere_is_followed() -> None:
    random, fusion, lost = np.random.default_rng(5), CameraFusion(2), 0
    for k in range(120):
        t, camera = k / RATE / 2, k % 2
        off = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]) if k >= 60 else None
        lost += fusion.take(camera, round(1e9 * t), seen(t, camera, random, off)) is None
    assert lost <= 2
