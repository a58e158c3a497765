"""Tags are found in rendered pictures, with poses as accurate as their corners allow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from extensions.vision.tags.detector import TagDetector
from extensions.vision.tags.tag_pose import NOISE, likeliest, poses_of
from extensions.vision.tests.tags.rendered import CAMERA, CORNERS, FACING, LENS, a_pose, tag
from quadrotor.errors import MeasurementError
from quadrotor.rotations import rotation_exp, rotation_log


@pytest.mark.parametrize("distance", [2.0, 3.0, 4.0])
def test_poses_in_pictures_are_within_the_bound_of_the_stated_corner_noise(distance: float) -> None:
    random, detector = np.random.default_rng(int(distance)), TagDetector(LENS)
    off, bound = np.zeros(2), np.zeros(2)
    found = 0
    for _ in range(25):
        position_c, R_ct = a_pose(random, distance)
        seen = detector.detect(CAMERA.take([tag(3, position_c, R_ct)], random))
        if not seen:
            continue  # strongly tilted and small: not read, and no claim
        ((number, pixels),) = seen
        pose = likeliest(poses_of(CORNERS, pixels, LENS), R_ct)
        turn = rotation_log(R_ct.T @ pose.R_cb)
        off += np.sum((pose.position_c - position_c) ** 2), np.sum(turn**2)
        spread = NOISE**2 * np.diag(np.linalg.inv(pose.information))
        bound += spread[:3].sum(), spread[3:].sum()
        found += number == 3
    assert found >= 22
    assert (off < 1.5**2 * bound).all(), np.sqrt(off / bound)


def test_a_tag_seen_from_the_side_is_read_from_four_metres() -> None:
    """Its cells are less than a pixel high there."""
    random, detector = np.random.default_rng(9), TagDetector(LENS)
    R_ct = FACING @ rotation_exp(np.array([np.radians(-60.0), 0.0, 0.0]))
    found = []
    for _ in range(10):
        position_c = np.array([*random.uniform(-0.5, 0.5, 2), 3.9])
        there = CAMERA.project(CORNERS @ R_ct.T + position_c)
        for number, pixels in detector.detect(CAMERA.take([tag(3, position_c, R_ct)], random)):
            found.append(number)
            np.testing.assert_allclose(pixels, there, atol=0.3)
    assert found.count(3) == len(found) >= 7


@pytest.mark.parametrize("distance", [0.35, 0.5, 0.8])
def test_a_near_tag_is_read_as_precisely_as_a_far_one(distance: float) -> None:
    """Its cells are many times as large as the blur of the lens."""
    random, detector = np.random.default_rng(12), TagDetector(LENS)
    for turn in np.linspace(0.0, 3.0, 4):
        R_ct = (
            FACING
            @ rotation_exp(np.array([0.4, 0.0, 0.0]))
            @ rotation_exp(np.array([0.0, 0.0, turn]))
        )
        position_c = np.array([*random.uniform(-0.03, 0.03, 2), distance])
        there = CAMERA.project(CORNERS @ R_ct.T + position_c)
        [(number, pixels)] = detector.detect(CAMERA.take([tag(3, position_c, R_ct)], random))
        assert number == 3
        np.testing.assert_allclose(pixels, there, atol=0.12)


@pytest.mark.parametrize("blur", [0.4, 0.6, 0.9])
def test_a_tag_seen_from_the_side_is_not_found_too_far_away_whatever_the_blur_of_the_lens(
    blur: float,
) -> None:
    random, detector = np.random.default_rng(11), TagDetector(LENS)
    camera, too_far = replace(CAMERA, blur=blur), []
    for turn in np.linspace(0.0, 3.0, 8):
        R_ct = FACING @ rotation_exp(np.array([0.0, 0.0, turn]))
        R_ct = rotation_exp(np.array([np.radians(56.0), 0.0, 0.0])) @ R_ct
        position_c = np.array([*random.uniform(-0.3, 0.3, 2), 3.0])
        for _, pixels in detector.detect(camera.take([tag(3, position_c, R_ct)], random)):
            pose = likeliest(poses_of(CORNERS, pixels, LENS), R_ct)
            too_far.append(pose.position_c[2] - position_c[2])
    assert len(too_far) >= 7
    assert abs(np.mean(too_far)) < 0.005  # with a fixed blur of 0.75: -9 mm at 0.4, 25 mm at 0.9


def test_a_tag_far_from_the_bodys_origin_gives_its_pose_alone() -> None:
    """OpenCV's solver of flat targets takes only points about their middle."""
    points, position_c = CORNERS + np.array([0.0, 0.0, 0.03]), np.array([-0.4, -0.15, 3.8])
    for turn in np.linspace(0.0, 3.0, 10):
        R_cb = FACING @ rotation_exp(np.array([np.radians(-64.0), 0.0, 0.0]))
        R_cb = R_cb @ rotation_exp(np.array([0.0, 0.0, turn]))
        poses = poses_of(points, CAMERA.project(points @ R_cb.T + position_c), LENS)
        assert poses[0].residual < 1e-4
        np.testing.assert_allclose(poses[0].position_c, position_c, atol=1e-3)


def test_noise_of_the_corners_alone_gives_poses_at_the_bound() -> None:
    random = np.random.default_rng(8)
    ratios = []
    for _ in range(150):
        position_c, R_ct = a_pose(random, 2.0)
        pixels = CAMERA.project(CORNERS @ R_ct.T + position_c)
        pose = likeliest(poses_of(CORNERS, pixels + NOISE * random.normal(size=(4, 2)), LENS), R_ct)
        error = np.concatenate([pose.position_c - position_c, rotation_log(R_ct.T @ pose.R_cb)])
        ratios.append(error @ pose.information @ error / NOISE**2)
    assert np.mean(ratios) == pytest.approx(6.0, rel=0.2)  # chi-square of six unknowns


def test_a_flat_tag_has_two_poses_and_the_attitude_expected_decides_when_both_fit() -> None:
    R_ct = FACING @ rotation_exp(np.array([0.12, 0.0, 0.0]))
    position_c = np.array([0.1, 0.1, 4.0])
    both = poses_of(CORNERS, CAMERA.project(CORNERS @ R_ct.T + position_c), LENS)
    assert len(both) == 2
    for pose in both:
        assert likeliest(both, pose.R_cb) is pose


def test_several_tags_in_different_planes_fix_the_pose_alone() -> None:
    R_cb = FACING @ rotation_exp(np.array([0.05, -0.03, 2.0]))
    points = np.concatenate([CORNERS, CORNERS @ rotation_exp(np.array([0.0, 1.0, 0.0])).T + 0.1])
    best, *_ = poses_of(points, CAMERA.project(points @ R_cb.T + (0.0, 0.2, 3.0)), LENS)
    np.testing.assert_allclose(best.position_c, (0.0, 0.2, 3.0), atol=1e-6)
    np.testing.assert_allclose(best.R_cb, R_cb, atol=1e-6)


def test_corners_come_in_the_order_of_the_upright_tag_however_it_is_turned() -> None:
    random = np.random.default_rng(2)
    for quarter in range(4):
        R_ct = FACING @ rotation_exp(np.array([0.0, 0.0, 0.5 * np.pi * quarter]))
        ((_, pixels),) = TagDetector(LENS).detect(
            CAMERA.take([tag(7, np.array([0.1, 0.0, 1.0]), R_ct)], random)
        )
        there = CAMERA.project(CORNERS @ R_ct.T + (0.1, 0.0, 1.0))
        np.testing.assert_allclose(pixels, there, atol=0.1)


@pytest.mark.parametrize("light", [0.02, 40.0])
def test_in_a_black_or_white_picture_there_are_no_tags(light: float) -> None:
    picture = replace(CAMERA, light=light).take(
        [tag(7, np.array([0.1, 0.0, 1.0]), FACING)], np.random.default_rng(3)
    )
    assert TagDetector(LENS).detect(picture) == []


def test_a_moving_tag_is_where_it_is_half_way_through_the_exposure_of_its_rows() -> None:
    """A rolling shutter exposes lower rows later."""
    velocity = np.array([1.0, 0.0, 0.0])
    camera = replace(CAMERA, exposure=0.004, readout=0.02, noise=0.0)
    place = np.array([0.0, 0.5, 2.0])
    moving = tag(5, place, FACING, velocity_c=velocity, angular_velocity_c=np.zeros(3))
    ((_, pixels),) = TagDetector(LENS).detect(camera.take([moving], np.random.default_rng(4)))
    rows = pixels[:, 1].mean()
    late = 0.02 * ((rows + 0.5) / 480 - 0.5)
    there = CAMERA.project(CORNERS @ FACING.T + place + late * velocity).mean(axis=0)
    np.testing.assert_allclose(pixels.mean(axis=0), there, atol=0.1)


def test_other_families_are_named_and_pictures_of_another_size_refused() -> None:
    with pytest.raises(MeasurementError, match="4X4_50"):
        TagDetector(LENS, "36h11")
    with pytest.raises(MeasurementError, match="320 x 240"):
        TagDetector(LENS).detect(np.zeros((240, 320), np.uint8))
