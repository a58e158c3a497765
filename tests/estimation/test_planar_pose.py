"""Pose from one frame of bearings (Sec. 6.2, eq. 13), against its information bound."""

from __future__ import annotations

import contextlib
import math

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from estimation.planar_pose import planar_pose
from quadrotor.errors import MeasurementError

Array = npt.NDArray[np.float64]
SQUARE = np.array([[1, 1, 0.1], [1, -1, 0.1], [-1, -1, 0.1], [-1, 1, 0.1]])
SIGMA = math.radians(1.5)


def bearings_of(beacons: Array, r: Array, R: Rotation) -> Array:
    d = beacons - r
    return R.inv().apply(d / np.linalg.norm(d, axis=1)[:, None])


def envelope(
    rng: np.random.Generator, low: float = 0.3, high: float = 2.0
) -> tuple[Array, Rotation]:
    r = np.array([*rng.uniform(-1.2, 1.2, 2), rng.uniform(low, high)])
    tilt = rng.uniform(-20, 20, 2)
    return r, Rotation.from_euler("ZYX", [rng.uniform(-180, 180), *tilt], degrees=True)


def blurred(x: Array, rng: np.random.Generator) -> Array:
    """Independent N(0, SIGMA) along two tangent axes of each bearing."""
    out = x + SIGMA * rng.normal(size=x.shape)
    out -= ((out - x) * x).sum(1)[:, None] * x
    return out / np.linalg.norm(out, axis=1)[:, None]


def jacobian(beacons: Array, r: Array, R: Rotation) -> Array:
    """Of the bearings (3 N) by position and rotation in world axes (6), by finite differences."""
    h = 1e-6
    columns = []
    for i in range(6):
        e = np.eye(6)[i] * h
        pair = [
            bearings_of(beacons, r + s * e[:3], Rotation.from_rotvec(s * e[3:]) * R).ravel()
            for s in (1, -1)
        ]
        columns.append((pair[0] - pair[1]) / (2 * h))
    return np.stack(columns, 1)


def bound(beacons: Array, r: Array, R: Rotation) -> Array:
    """Cramer-Rao bound (6, 6): position, then rotation in world axes."""
    J = jacobian(beacons, r, R)
    return SIGMA**2 * np.linalg.inv(J.T @ J)


def rotation_of(q: Array) -> Rotation:
    return Rotation.from_quat(np.roll(q, -1))


@pytest.mark.parametrize("count", [4, 5, 12])
@pytest.mark.parametrize("tilted_plane", [False, True])
def test_exact_bearings_give_the_exact_pose(
    count: int, tilted_plane: bool, rng: np.random.Generator
) -> None:
    for _ in range(20):
        angles = np.sort(rng.uniform(0, 2 * np.pi, count)) + np.arange(count) * 0.3
        beacons = np.stack([np.cos(angles), 1.3 * np.sin(angles), 0.1 + 0 * angles], 1)
        r, R = envelope(rng)
        if tilted_plane:
            world = Rotation.random(rng=rng)
            beacons, r, R = world.apply(beacons) + 3.0, world.apply(r) + 3.0, world * R
        got = planar_pose(beacons, bearings_of(beacons, r, R), SIGMA)
        np.testing.assert_allclose(got.position_w, r, atol=1e-8)
        assert (R.inv() * rotation_of(got.quaternion_wb)).magnitude() < 1e-8
        assert got.quaternion_wb[0] >= 0.0
        assert got.residual < 1e-8


def test_the_plane_may_go_through_the_world_origin(rng: np.random.Generator) -> None:
    """Print divides by its distance."""
    beacons = SQUARE - [0.0, 0.0, 0.1]
    r, R = envelope(rng)
    got = planar_pose(beacons, bearings_of(beacons, r, R), SIGMA)
    np.testing.assert_allclose(got.position_w, r, atol=1e-9)


def test_beacons_behind_the_downward_axis_are_used() -> None:
    """A tilted vehicle low in a corner sees one beyond 90 degrees of its downward axis."""
    r, R = np.array([1.2, 1.2, 0.3]), Rotation.from_euler("ZYX", [0.0, -0.35, 0.35])
    x = bearings_of(SQUARE, r, R)
    assert x[:, 2].max() > 0.0
    np.testing.assert_allclose(planar_pose(SQUARE, x, SIGMA).position_w, r, atol=1e-9)


def test_noise_reaches_the_information_bound(rng: np.random.Generator) -> None:
    """Reference: bound 0.145 m and 3.96 deg over the envelope, this method 1.01 times that.

    600 poses know an rms to 5 % only, but its ratio to that of the linear optimum for the same
    noise to 1 %; the homography without refinement is at 1.14.
    """
    got, linear = np.zeros((600, 6)), np.zeros((600, 6))
    for k in range(len(got)):
        r, R = envelope(rng)
        x = bearings_of(SQUARE, r, R)
        noisy = blurred(x, rng)
        pose = planar_pose(SQUARE, noisy, SIGMA)
        got[k, :3] = pose.position_w - r
        got[k, 3:] = (rotation_of(pose.quaternion_wb) * R.inv()).as_rotvec()
        linear[k] = np.linalg.lstsq(jacobian(SQUARE, r, R), (noisy - x).ravel())[0]
    for part, unit, reference in ((slice(0, 3), 1.0, 0.145), (slice(3, 6), np.degrees(1), 3.96)):
        ours = unit * math.sqrt((got[:, part] ** 2).sum(1).mean())
        optimal = unit * math.sqrt((linear[:, part] ** 2).sum(1).mean())
        print(f"rms {ours:.4f}, linear optimum {optimal:.4f}, reference bound {reference}")
        assert optimal == pytest.approx(reference, rel=0.15)
        assert 0.95 < ours / optimal < 1.06


def test_covariance_is_the_bound_with_its_units_axes_and_order(rng: np.random.Generator) -> None:
    for _ in range(20):
        r, R = envelope(rng)
        got = planar_pose(SQUARE, bearings_of(SQUARE, r, R), SIGMA).covariance
        np.testing.assert_allclose(got, bound(SQUARE, r, R), rtol=1e-3, atol=1e-8)
        np.testing.assert_allclose(got, got.T, atol=1e-15)


def test_near_the_beacons_plane_a_prediction_saves_the_pose(rng: np.random.Generator) -> None:
    alone, helped, limit = [], [], []
    for _ in range(150):
        r, R = envelope(rng, 0.05, 0.15)
        x = blurred(bearings_of(SQUARE, r, R), rng)
        wobble = Rotation.from_rotvec(rng.normal(0, 0.01, 3))
        prediction = (r + rng.normal(0, 0.03, 3), np.roll((R * wobble).as_quat(), 1))
        with contextlib.suppress(MeasurementError):
            alone.append(((planar_pose(SQUARE, x, SIGMA).position_w - r) ** 2).sum())
        got = planar_pose(SQUARE, x, SIGMA, prediction)
        helped.append(((got.position_w - r) ** 2).sum())
        limit.append(np.trace(bound(SQUARE, r, R)[:3, :3]))
    helped_rms, limit_rms = math.sqrt(np.mean(helped)), math.sqrt(np.mean(limit))
    lost = len(helped) - sum(square < 9.0 * limit_rms**2 for square in alone)
    print(f"helped {helped_rms:.3f} m, bound {limit_rms:.3f} m, alone {lost} refused or far off")
    assert helped_rms < 1.3 * limit_rms
    assert lost > 0.1 * len(helped)


def test_a_wrong_prediction_does_not_spoil_a_good_view(rng: np.random.Generator) -> None:
    r, R = np.array([0.3, -0.2, 1.0]), Rotation.from_euler("z", 1.0)
    x = bearings_of(SQUARE, r, R)
    got = planar_pose(SQUARE, x, SIGMA, (np.array([5.0, 5.0, 3.0]), np.array([0.0, 0, 0, 1.0])))
    np.testing.assert_allclose(got.position_w, r, atol=1e-9)


GOOD = bearings_of(SQUARE, np.array([0.2, 0.1, 1.0]), Rotation.identity())


@pytest.mark.parametrize(
    ("beacons", "bearings", "sigma", "says"),
    [
        (SQUARE[:3], GOOD[:3], SIGMA, "at least 4"),
        (SQUARE, GOOD[:3], SIGMA, r"must be \(N, 3\)"),
        (SQUARE[:, :2], GOOD[:, :2], SIGMA, r"must be \(N, 3\)"),
        (np.zeros((0, 3)), np.zeros((0, 3)), SIGMA, "at least 4"),
        (SQUARE * np.nan, GOOD, SIGMA, "not finite"),
        (SQUARE, GOOD * np.inf, SIGMA, "not finite"),
        (SQUARE, 2.0 * GOOD, SIGMA, "has length 2"),
        (SQUARE, 0.0 * GOOD, SIGMA, "has length 0"),
        (SQUARE, GOOD, 0.0, "sigma"),
        (SQUARE, GOOD, math.nan, "sigma"),
        (np.outer(np.arange(4), [1, 2, 3]), GOOD, SIGMA, "one line"),
        (np.ones((4, 3)), GOOD, SIGMA, "one line or one spot"),
        (SQUARE + np.diag([0, 0, 0.2, 0])[:4, :3], GOOD, SIGMA, "leave their common plane"),
        (SQUARE, np.tile(GOOD[0], (4, 1)), SIGMA, "do not determine a pose"),
    ],
)
def test_degenerate_input_is_refused_in_one_line(
    beacons: Array, bearings: Array, sigma: float, says: str
) -> None:
    with pytest.raises(MeasurementError, match=says) as caught:
        planar_pose(beacons, bearings, sigma)
    assert "\n" not in str(caught.value)


def test_three_beacons_on_a_line_are_refused() -> None:
    beacons = np.array([[-1, 0, 0], [0, 0, 0], [1, 0, 0], [0.0, 1, 0]])
    x = bearings_of(beacons, np.array([0.2, 0.1, 1.0]), Rotation.identity())
    with pytest.raises(MeasurementError, match="three of four beacons stand on one line"):
        planar_pose(beacons, x, SIGMA)


def test_bearings_that_no_pose_explains_are_refused() -> None:
    """Two beacons swapped."""
    x = bearings_of(SQUARE, np.array([0.5, -0.3, 1.0]), Rotation.identity())[[1, 0, 2, 3]]
    with pytest.raises(MeasurementError, match=r"no pose fits|do not determine"):
        planar_pose(SQUARE, x, SIGMA)


def test_a_start_on_the_wrong_side_of_the_plane_still_arrives() -> None:
    """Low above a beacon noise can put the homography's pose below the plane; two steps stall."""
    rng = np.random.default_rng(400634066)
    for _ in range(457):
        r, R = envelope(rng)
        x = blurred(bearings_of(SQUARE, r, R), rng)
    got = planar_pose(SQUARE, x, SIGMA)
    assert np.linalg.norm(got.position_w - r) < 0.3


def test_inputs_are_not_changed() -> None:
    beacons, bearings = SQUARE.copy(), GOOD.copy()
    planar_pose(beacons, bearings, SIGMA)
    np.testing.assert_array_equal(beacons, SQUARE)
    np.testing.assert_array_equal(bearings, GOOD)
