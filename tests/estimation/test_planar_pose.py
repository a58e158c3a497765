"""Pose from one frame of bearings (Sec. 6.2, eq. 13), against its information bound."""

from __future__ import annotations

import contextlib
import math
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimation.poses import planar_pose as module
from estimation.poses.planar_pose import PlanarPoseSolver, planar_pose
from quadrotor.errors import DegenerateGeometryError, MeasurementError
from quadrotor.records import Array

SQUARE = np.array([[1, 1, 0.1], [1, -1, 0.1], [-1, -1, 0.1], [-1, 1, 0.1]])
SIGMA = math.radians(1.5)


def bearings_of(beacons: Array, r: Array, R: Rotation) -> Array:
    d = beacons - r
    return np.asarray(R.inv().apply(d / np.linalg.norm(d, axis=1)[:, None]))


def envelope(
    rng: np.random.Generator, low: float = 0.3, high: float = 2.0
) -> tuple[Array, Rotation]:
    r = np.array([*rng.uniform(-1.2, 1.2, 2), rng.uniform(low, high)])
    tilt = rng.uniform(-20, 20, 2)
    return r, Rotation.from_euler("ZYX", [rng.uniform(-180, 180), *tilt], degrees=True)


def blurred(x: Array, rng: np.random.Generator) -> Array:
    """Add independent N(0, SIGMA) along two tangent axes of each bearing."""
    out = x + SIGMA * rng.normal(size=x.shape)
    out -= ((out - x) * x).sum(1)[:, None] * x
    return np.asarray(out / np.linalg.norm(out, axis=1)[:, None])


def jacobian(beacons: Array, r: Array, R: Rotation) -> Array:
    """Return the derivative of the bearings (3 N) by position and rotation (6).

    The rotation is in world axes; the derivative is by finite differences.
    """
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
    """Return the Cramer-Rao bound (6, 6): position, then rotation in world axes."""
    J = jacobian(beacons, r, R)
    return np.asarray(SIGMA**2 * np.linalg.inv(J.T @ J), dtype=np.float64)


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
    """The printed equation divides by its distance."""
    beacons = SQUARE - [0.0, 0.0, 0.1]
    r, R = envelope(rng)
    got = planar_pose(beacons, bearings_of(beacons, r, R), SIGMA)
    np.testing.assert_allclose(got.position_w, r, atol=1e-9)


def test_beacons_behind_the_downward_axis_are_used() -> None:
    """A tilted vehicle low in a corner sees a beacon beyond 90 degrees of its downward axis."""
    r, R = np.array([1.2, 1.2, 0.3]), Rotation.from_euler("ZYX", [0.0, -0.35, 0.35])
    x = bearings_of(SQUARE, r, R)
    assert x[:, 2].max() > 0.0
    np.testing.assert_allclose(planar_pose(SQUARE, x, SIGMA).position_w, r, atol=1e-9)


def test_noise_reaches_the_information_bound(rng: np.random.Generator) -> None:
    """Reference: bound 0.145 m and 3.96 deg over the envelope; this method has 1.01 times that.

    600 poses determine an rms only to 5 %, but its ratio to that of the linear optimum for the same
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
        with contextlib.suppress(MeasurementError):
            got = planar_pose(SQUARE, x, SIGMA, prediction)
            helped.append(((got.position_w - r) ** 2).sum())
            limit.append(np.trace(bound(SQUARE, r, R)[:3, :3]))
    helped_rms, limit_rms = math.sqrt(np.mean(helped)), math.sqrt(np.mean(limit))
    lost = len(helped) - sum(square < 9.0 * limit_rms**2 for square in alone)
    print(f"helped {helped_rms:.3f} m, bound {limit_rms:.3f} m, alone {lost} refused or far off")
    assert len(helped) >= 149  # of 150; one in 1500 is lost during the iteration and refused
    assert helped_rms < 1.3 * limit_rms
    assert lost > 0.05 * len(helped)


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
        (np.ones((4, 3)), GOOD, SIGMA, "one line or at one point"),
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
    with pytest.raises(MeasurementError, match="three of four beacons lie on one line"):
        planar_pose(beacons, x, SIGMA)


def test_bearings_that_no_pose_explains_are_refused() -> None:
    """Two beacons are swapped."""
    x = bearings_of(SQUARE, np.array([0.5, -0.3, 1.0]), Rotation.identity())[[1, 0, 2, 3]]
    with pytest.raises(MeasurementError, match=r"no pose fits|do not determine"):
        planar_pose(SQUARE, x, SIGMA)


def test_a_start_on_the_wrong_side_of_the_plane_still_arrives() -> None:
    """Low above a beacon, noise can put the homography's pose below the plane; two steps stall."""
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


@pytest.mark.parametrize("count", [4, 7])
def test_turning_and_moving_the_world_and_its_beacons_moves_the_pose_with_them(
    count: int, rng: np.random.Generator
) -> None:
    angle = np.arange(count) * 1.7 + 0.05 * np.arange(count) ** 2  # without symmetries
    beacons = np.stack([np.cos(angle), np.sin(angle), 0.1 + 0 * angle], 1)
    for _ in range(20):
        r, R = envelope(rng)
        x = blurred(bearings_of(beacons, r, R), rng)
        world, shift = Rotation.random(rng=rng), rng.normal(0, 3, 3)
        here = planar_pose(beacons, x, SIGMA)
        there = planar_pose(world.apply(beacons) + shift, x, SIGMA)
        T = np.kron(np.eye(2), world.as_matrix())
        np.testing.assert_allclose(
            there.position_w, world.apply(here.position_w) + shift, atol=1e-9
        )
        assert (world * rotation_of(here.quaternion_wb)).approx_equal(
            rotation_of(there.quaternion_wb), atol=1e-9
        )
        np.testing.assert_allclose(
            there.covariance, T @ here.covariance @ T.T, rtol=1e-6, atol=1e-9
        )
        assert there.residual == pytest.approx(here.residual, abs=1e-12)


def test_turning_the_body_turns_the_attitude_and_leaves_the_position(
    rng: np.random.Generator,
) -> None:
    """Yaw invariance, and that about any other axis."""
    for _ in range(20):
        r, R = envelope(rng)
        x, turn = blurred(bearings_of(SQUARE, r, R), rng), Rotation.random(rng=rng)
        one, other = planar_pose(SQUARE, x, SIGMA), planar_pose(SQUARE, turn.inv().apply(x), SIGMA)
        np.testing.assert_allclose(other.position_w, one.position_w, atol=1e-9)
        assert (rotation_of(one.quaternion_wb) * turn).approx_equal(
            rotation_of(other.quaternion_wb), atol=1e-9
        )


@pytest.mark.parametrize("count", [4, 9])
def test_the_order_of_the_beacons_does_not_matter(count: int, rng: np.random.Generator) -> None:
    angle = np.arange(count) * 1.7 + 0.05 * np.arange(count) ** 2  # without symmetries
    beacons = np.stack([np.cos(angle), 1.1 * np.sin(angle), 0.1 + 0 * angle], 1)
    for _ in range(20):
        r, R = envelope(rng)
        x, order = blurred(bearings_of(beacons, r, R), rng), rng.permutation(count)
        one, other = planar_pose(beacons, x, SIGMA), planar_pose(beacons[order], x[order], SIGMA)
        np.testing.assert_allclose(other.position_w, one.position_w, atol=1e-9)
        np.testing.assert_allclose(other.quaternion_wb, one.quaternion_wb, atol=1e-9)


@pytest.mark.parametrize("distance", [0.0, 0.1, 1.0, 5.0])
def test_the_distance_of_the_world_origin_from_the_plane_changes_nothing(
    distance: float, rng: np.random.Generator
) -> None:
    for _ in range(20):
        r, R = envelope(rng)
        x = blurred(bearings_of(SQUARE, r, R), rng)
        shift = np.array([0.0, 0.0, distance - 0.1])
        one, other = planar_pose(SQUARE, x, SIGMA), planar_pose(SQUARE + shift, x, SIGMA)
        np.testing.assert_allclose(other.position_w, one.position_w + shift, atol=1e-9)
        np.testing.assert_allclose(other.quaternion_wb, one.quaternion_wb, atol=1e-9)


def test_the_covariance_is_that_of_the_errors(rng: np.random.Generator) -> None:
    """Normalised squared errors of a 6-vector have mean 6; here over poses at least 0.6 m up.

    The mean of 2000 is known to 0.08; lower, the tail of large errors adds some percent.
    """
    squares = []
    for _ in range(2000):
        r, R = envelope(rng, 0.6)
        pose = planar_pose(SQUARE, blurred(bearings_of(SQUARE, r, R), rng), SIGMA)
        error = np.r_[pose.position_w - r, (rotation_of(pose.quaternion_wb) * R.inv()).as_rotvec()]
        squares.append(error @ np.linalg.solve(pose.covariance, error))
    print(f"mean normalised squared error {np.mean(squares):.3f}")
    assert 5.6 < np.mean(squares) < 6.6


def test_near_the_plane_positions_stay_bounded(rng: np.random.Generator) -> None:
    """The prediction is 5 cm and 3 deg off; at most 0.8 % are beyond 0.5 m, none by metres."""
    errors = []
    for _ in range(1000):
        r, R = envelope(rng, 0.09, 0.11)
        off, turn = rng.normal(size=(2, 3))
        turned = Rotation.from_rotvec(np.radians(3.0) * turn / np.linalg.norm(turn)) * R
        prediction = r + 0.05 * off / np.linalg.norm(off), np.roll(turned.as_quat(), 1)
        with contextlib.suppress(MeasurementError):
            pose = planar_pose(SQUARE, blurred(bearings_of(SQUARE, r, R), rng), SIGMA, prediction)
            errors.append(np.linalg.norm(pose.position_w - r))
    print(f"{np.mean(np.array(errors) > 0.5):.2%} beyond 0.5 m, largest {max(errors):.2f} m")
    assert len(errors) > 995
    assert np.mean(np.array(errors) > 0.5) <= 0.012  # 0.5 % and three times its deviation
    assert max(errors) < 3.0


def test_lists_and_foreign_arrays_give_the_same_pose(rng: np.random.Generator) -> None:
    solver = PlanarPoseSolver(SQUARE)
    r, R = envelope(rng)
    x = np.round(bearings_of(SQUARE, r, R).astype(np.float32), 3)
    expected = solver.solve(x.astype(float), SIGMA)
    read_only = x.astype(float)
    read_only.flags.writeable = False
    for same in (x, x.tolist(), np.asfortranarray(x, dtype=float), read_only):
        got = solver.solve(same, SIGMA)  # type: ignore[arg-type]  # what it was not declared for
        np.testing.assert_array_equal(got.position_w, expected.position_w)
        np.testing.assert_array_equal(got.covariance, expected.covariance)
    assert solver.solve(x.astype(float), 1).residual == pytest.approx(expected.residual, abs=1e-2)


def test_poses_of_one_solver_do_not_share_memory(rng: np.random.Generator) -> None:
    solver = PlanarPoseSolver(SQUARE)
    first = solver.solve(GOOD, SIGMA)
    position = first.position_w.copy()
    r, R = envelope(rng)
    solver.solve(bearings_of(SQUARE, r, R), SIGMA)
    np.testing.assert_array_equal(first.position_w, position)


IN_PLANE = bearings_of(SQUARE, np.array([0.2, 0.1, 0.1]), Rotation.identity())


@pytest.mark.parametrize(
    ("beacons", "bearings", "says"),
    [
        (SQUARE[:3], GOOD[:3], "at least 4"),
        (np.outer(np.arange(4), [1, 2, 3]), GOOD, "one line"),
        (SQUARE + np.diag([0, 0, 0.2, 0])[:4, :3], GOOD, "leave their common plane"),
        (SQUARE, IN_PLANE, "all lie in one plane"),
    ],
)
def test_degenerate_geometry_has_its_own_type(beacons: Array, bearings: Array, says: str) -> None:
    with pytest.raises(DegenerateGeometryError, match=says):
        planar_pose(beacons, bearings, SIGMA)


def test_in_the_beacons_plane_a_prediction_is_enough() -> None:
    r = np.array([0.2, 0.1, 0.1])
    prediction = r + np.array([0.03, -0.02, 0.02]), np.array([1.0, 0.01, 0.0, 0.01])
    got = planar_pose(SQUARE, IN_PLANE, SIGMA, prediction)
    assert np.linalg.norm(got.position_w - r) < 1e-4


@pytest.mark.parametrize(
    "prediction", [(np.full(3, np.nan), np.array([1.0, 0, 0, 0])), (np.zeros(3), np.zeros(4))]
)
def test_a_prediction_that_is_no_pose_is_refused(prediction: tuple[Array, Array]) -> None:
    with pytest.raises(MeasurementError, match="predicted pose is not finite"):
        planar_pose(SQUARE, GOOD, SIGMA, prediction)


def test_garbage_is_refused_in_words() -> None:
    with pytest.raises(MeasurementError, match="array of numbers"):
        PlanarPoseSolver(SQUARE).solve("east", SIGMA)  # type: ignore[arg-type]
    with pytest.raises(MeasurementError, match="shape"):
        PlanarPoseSolver(SQUARE).solve(GOOD[0], SIGMA)


def test_of_more_than_four_beacons_another_four_may_start_the_search(
    rng: np.random.Generator,
) -> None:
    """The four widest beacons of this layout often lead to a wrong minimum: none is refused."""
    flat = np.random.default_rng(8).uniform(-1.0, 1.0, (8, 2))
    solver = PlanarPoseSolver(np.column_stack([flat, np.full(8, 0.1)]))
    for _ in range(2000):
        r, R = envelope(rng)
        x = blurred(bearings_of(solver.plane.beacons_w, r, R), rng)
        assert np.linalg.norm(solver.solve(x, SIGMA).position_w - r) < 5.0


class SlowKernel:
    """Fake of the compiled frame, which compiles while another thread may request it too."""

    def __init__(self) -> None:
        self.signatures: list[str] = []
        self.compiled = 0
        self._together = threading.Barrier(2)
        self._may_compile = True

    def __call__(self, *_: object) -> None:
        with contextlib.suppress(threading.BrokenBarrierError):
            self._together.wait(0.2)
        assert self._may_compile, "compilation disabled"
        self.compiled += 1
        self.signatures.append("(double[:, :], double[:, :], double)")

    def disable_compile(self) -> None:
        self._may_compile = False


def test_two_threads_that_need_it_first_at_once_both_have_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kernel = SlowKernel()
    monkeypatch.setattr(module, "solve_frame", kernel)
    module._ready_kernel.cache_clear()
    try:
        with ThreadPoolExecutor(2) as threads:
            found = [threads.submit(module._ready_kernel) for _ in range(2)]
            assert [one.result() for one in found] == [kernel, kernel]
    finally:
        module._ready_kernel.cache_clear()
    assert kernel.compiled == 1
