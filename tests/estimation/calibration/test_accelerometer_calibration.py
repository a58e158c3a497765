"""Sec. 5.2: T and b from poses held still, and which poses are missing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimation.calibration.accelerometer import FACES, coverage, face_of, identify_accelerometer
from estimation.calibration.still_poses import StillPose, StillPoses
from quadrotor.errors import DegenerateGeometryError, MeasurementError
from quadrotor.vehicle_model import GRAVITY

T = np.array([[1.02, 0.01, -0.015], [-0.012, 0.985, 0.008], [0.006, -0.01, 1.01]])
B = np.array([0.25, -0.15, 0.4])
COUNT = 0.0039 * GRAVITY  # m/s^2 of a count


def reading(up_b: np.ndarray) -> np.ndarray:
    """Return the reading at rest of a sensor with T and B."""
    return np.asarray(np.linalg.solve(T, GRAVITY * up_b) + B)


def pose(up_b: np.ndarray, told: np.ndarray | None) -> StillPose:
    return StillPose(reading(up_b), told, 0.03)


def tracked_poses(
    rng: np.random.Generator, count: int = 12, tilt: float = 70.0, noise: float = 0.2
) -> list[StillPose]:
    """Return poses tilted by up to `tilt` deg about both axes, reported with `noise` deg."""
    poses = []
    for _ in range(count):
        roll, pitch = rng.uniform(-tilt, tilt, 2)
        R = Rotation.from_euler("xy", [roll, pitch], degrees=True).as_matrix()
        told = Rotation.from_rotvec(np.radians(noise) * rng.standard_normal(3)).as_matrix() @ R
        poses.append(pose(R.T[:, 2], told.T[:, 2]))
    return poses


def test_exact_poses_give_t_and_b_exactly(rng: np.random.Generator) -> None:
    found = identify_accelerometer(tracked_poses(rng, noise=0.0))
    np.testing.assert_allclose(found.matrix, T, atol=1e-12)
    np.testing.assert_allclose(found.bias, B, atol=1e-11)
    assert found.rms < 1e-11


def test_twelve_poses_within_70_degrees_reach_the_papers_use(rng: np.random.Generator) -> None:
    biases, matrices = [], []
    for _ in range(200):
        found = identify_accelerometer(tracked_poses(rng))
        biases.append(np.abs(found.bias - B).max())
        matrices.append(np.abs(found.matrix - T).max())
    print(f"95 %: bias {np.percentile(biases, 95):.4f} m/s², T {np.percentile(matrices, 95):.5f}")
    assert np.median(biases) < 0.06
    assert np.median(matrices) < 0.005


def test_six_faces_need_no_tracker() -> None:
    found = identify_accelerometer([pose(np.array(up), None) for up in FACES.values()])
    assert np.abs(found.bias - B).max() < 0.02
    np.testing.assert_allclose(found.matrix, T, atol=1e-9)


def test_the_condition_number_is_that_of_the_faces() -> None:
    measured = GRAVITY * np.array(list(FACES.values()))
    assert coverage(measured).condition_number == pytest.approx(5.66, abs=0.01)
    assert coverage(measured).next_face == ""


def test_poses_turned_about_one_axis_are_refused_with_the_missing_one() -> None:
    angles = np.radians([-80, -40, 0, 40, 80])
    ups = [np.array([0.0, np.sin(a), np.cos(a)]) for a in angles]
    with pytest.raises(DegenerateGeometryError, match=r"rank 3 of 4.*next: nose (up|down)"):
        identify_accelerometer([pose(up, up) for up in ups])


def test_poses_too_near_to_each_other_are_refused(rng: np.random.Generator) -> None:
    with pytest.raises(DegenerateGeometryError, match=r"condition number.*next: upside down"):
        identify_accelerometer(tracked_poses(rng, tilt=20.0))


@pytest.mark.parametrize("count", range(POSES := 4))
def test_too_few_poses_are_refused_with_the_next_one(count: int) -> None:
    ups = [np.array(up) for up in FACES.values()][:count]
    with pytest.raises(MeasurementError, match=rf"{count} poses, needed are 4.*next: \w"):
        identify_accelerometer([pose(up, None) for up in ups])


def test_following_the_advice_ends_with_enough() -> None:
    measured = np.empty((0, 3))
    for _ in range(6):
        face = coverage(measured).next_face
        if not face:
            break
        measured = np.vstack([measured, reading(np.array(FACES[face]))])
    assert coverage(measured).next_face == ""
    assert coverage(measured).condition_number < 12.0


def test_a_pose_on_no_face_is_refused_without_a_tracker() -> None:
    with pytest.raises(MeasurementError, match=r"45° from '(upright|nose up)'"):
        face_of(np.array([6.9, 0.0, 6.9]))


# ---------------------------------------------------------------------- poses held still
RATE = 100.0


def hold(
    finder: StillPoses, up: np.ndarray, seconds: float, rng: np.random.Generator, told: bool = True
) -> str:
    moving = ""
    for _ in range(round(seconds * RATE)):
        noisy = reading(up) + 0.03 * rng.standard_normal(3)
        moving = finder.add(noisy, 0.003 * rng.standard_normal(3), up if told else None).moving
    return moving


def test_each_pose_held_counts_once(rng: np.random.Generator) -> None:
    finder = StillPoses(RATE)
    hold(finder, np.array(FACES["upright"]), 5.0, rng)
    assert len(finder.poses) == 1
    assert finder.add(np.array([3.0, 0, 9.0]), np.array([1.0, 0, 0])).moving.startswith("it turns")
    hold(finder, np.array(FACES["upright"]), 2.0, rng)
    assert len(finder.poses) == 1
    hold(finder, np.array(FACES["nose up"]), 1.5, rng, told=False)
    assert [pose.up_b is None for pose in finder.poses] == [False, True]
    assert finder.poses[0].measured == pytest.approx(reading(np.array([0, 0, 1.0])), abs=0.02)


def test_a_moved_vehicle_begins_its_pose_anew(rng: np.random.Generator) -> None:
    finder = StillPoses(RATE)
    hold(finder, np.array(FACES["upright"]), 0.9, rng)
    finder.add(np.array([0, 0, 9.81]), np.array([0, 0, 0.5]))
    hold(finder, np.array(FACES["upright"]), 0.9, rng)
    assert finder.poses == []
    assert finder.add(reading(np.array([0, 0, 1.0])), np.zeros(3)).share == pytest.approx(0.91)


@pytest.mark.parametrize(
    ("force", "said"), [((19.5, 0.0, 1.0), "saturated at 19.5"), ((np.nan, 0.0, 9.8), "not finite")]
)
def test_what_the_sensor_cannot_show_is_no_pose(
    force: tuple[float, float, float], said: str
) -> None:
    assert said in StillPoses(RATE).add(np.array(force), np.zeros(3)).moving


def test_a_shaken_vehicle_says_by_how_much(rng: np.random.Generator) -> None:
    finder = StillPoses(RATE)
    states = [
        finder.add(np.array([0, 0, 9.81]) + 0.5 * rng.standard_normal(3), np.zeros(3))
        for _ in range(100)
    ]
    assert "shakes by 0." in states[-1].moving
    assert finder.poses == []
