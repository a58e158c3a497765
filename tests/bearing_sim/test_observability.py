"""Cramer-Rao bound of a frame, and its map over a slice of the flight volume."""

from __future__ import annotations

import math
import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bearing_sim.beacons import PAPER_BEACONS, PRESETS, Beacons
from bearing_sim.bearing_parameters import BearingParameters
from bearing_sim.emulator import BearingEmulator
from bearing_sim.observability import LARGEST_MAP, FieldOfView, bound_map, frame_bound
from quadrotor.plain_rotations import matrix_of
from quadrotor.records import Array

SIGMA = math.radians(1.5)


def generator(name: str) -> np.random.Generator:
    seed = zlib.crc32(name.encode())
    print(f"seed {seed}")
    return np.random.default_rng(seed)


def rotation(rng: np.random.Generator) -> Array:
    q = rng.normal(size=4)
    return matrix_of(q / np.linalg.norm(q))


def turned(R: Array, phi: Array) -> Array:
    """Return exp(phi) R."""
    angle = np.linalg.norm(phi)
    if angle == 0.0:
        return R
    x, y, z = phi / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: Array = (np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K) @ R
    return turn


def differenced(r: Array, R: Array, beacons: Array, sigma: float) -> tuple[float, float]:
    """Return the same by finite differences of the bearings themselves, in body axes."""

    def bearings(move: Array) -> Array:
        ray = beacons - (r + move[:3])
        return np.asarray((ray / np.linalg.norm(ray, axis=1)[:, None]) @ turned(R, move[3:]))

    h = 1e-5
    J = np.stack(
        [((bearings(h * e) - bearings(-h * e)) / (2.0 * h)).ravel() for e in np.eye(6)], axis=1
    )
    bound = sigma**2 * np.linalg.inv(J.T @ J)
    return math.sqrt(np.trace(bound[:3, :3])), math.sqrt(np.trace(bound[3:, 3:]))


def test_it_is_the_inverse_of_the_information_by_finite_differences() -> None:
    rng = generator("finite differences")
    for _ in range(50):
        beacons = rng.uniform(-2.0, 2.0, (int(rng.integers(4, 9)), 3)) * (1.0, 1.0, 0.1)
        r = np.array([*rng.uniform(-1.2, 1.2, 2), rng.uniform(0.4, 2.0)])
        R = rotation(rng)
        found = frame_bound(r, R, beacons, SIGMA)
        assert found == pytest.approx(differenced(r, R, beacons, SIGMA), rel=1e-6)


def test_above_the_middle_of_the_papers_square_it_is_what_a_hand_gets() -> None:
    """(0, 0, h + 0.1) over corners (±1, ±1), with R² = 2 + h².

    By symmetry z and yaw decouple, and x is coupled with pitch, y with roll.
    """
    h = 0.9
    square = 2.0 + h * h
    lateral = 4.0 * (1.0 - 1.0 / square)  # sum of 1 - d_x²
    axial = 4.0 * (1.0 - h * h / square)  # sum of 1 - d_z²
    lever = 4.0 * h / square  # sum of d_z / R
    x = lateral / square - lever**2 / lateral
    pitch = lateral - lever**2 / (lateral / square)
    position = SIGMA * math.sqrt(2.0 / x + square / axial)
    attitude = SIGMA * math.sqrt(2.0 / pitch + 1.0 / axial)
    found = frame_bound((0.0, 0.0, 1.0), np.eye(3), PAPER_BEACONS.positions_w, SIGMA)
    assert found == pytest.approx((position, attitude), rel=1e-12)
    assert found == pytest.approx((0.0747, 0.0445), abs=1e-4)


def test_the_scatter_of_least_squares_reaches_it() -> None:
    """Linearised least squares on noisy bearings: the rms error is within chance."""
    rng = generator("scatter")
    beacons, r, R = PAPER_BEACONS.positions_w, np.array([0.4, -0.3, 1.1]), rotation(rng)
    sigma, count, h = 1e-4, 4000, 1e-5
    ray = beacons - r
    d = ray / np.linalg.norm(ray, axis=1)[:, None]
    tangents = np.array([np.linalg.svd(one[None])[2][1:] for one in d])  # (N, 2, 3)

    def seen(move: Array) -> Array:
        ray = (beacons - (r + move[:3])) @ turned(np.eye(3), -move[3:]).T
        unit = ray / np.linalg.norm(ray, axis=1)[:, None]
        return np.asarray(np.einsum("nij,nj->ni", tangents, unit)).ravel()

    J = np.stack([(seen(h * e) - seen(-h * e)) / (2.0 * h) for e in np.eye(6)], axis=1)
    errors = sigma * rng.normal(size=(count, 2 * len(beacons))) @ np.linalg.pinv(J).T
    found = frame_bound(r, R, beacons, sigma)
    for part, bound in ((errors[:, :3], found[0]), (errors[:, 3:], found[1])):
        assert math.sqrt((part**2).sum(axis=1).mean()) == pytest.approx(bound, rel=0.04)


def test_neither_attitude_nor_the_worlds_axes_matter() -> None:
    rng = generator("rotation")
    r, beacons = np.array([0.3, -0.7, 1.2]), PAPER_BEACONS.positions_w
    expected = frame_bound(r, np.eye(3), beacons, SIGMA)
    Q, shift = rotation(rng), rng.normal(size=3)
    assert frame_bound(r, rotation(rng), beacons, SIGMA) == pytest.approx(expected, rel=1e-10)
    moved = frame_bound(Q @ r + shift, rotation(rng), beacons @ Q.T + shift, SIGMA)
    assert moved == pytest.approx(expected, rel=1e-10)


def test_it_grows_with_sigma_and_its_length_with_the_size_of_everything() -> None:
    r, beacons = np.array([0.3, -0.7, 1.2]), PAPER_BEACONS.positions_w
    position, attitude = frame_bound(r, np.eye(3), beacons, SIGMA)
    assert frame_bound(r, np.eye(3), beacons, 2.0 * SIGMA) == pytest.approx(
        (2.0 * position, 2.0 * attitude)
    )
    assert frame_bound(3.0 * r, np.eye(3), 3.0 * beacons, SIGMA) == pytest.approx(
        (3.0 * position, attitude)
    )


places = st.tuples(*(st.floats(-3.0, 3.0) for _ in range(3)))


@given(st.lists(places, min_size=4, max_size=8), places, places)
def test_one_beacon_more_is_never_worse(
    rows: list[tuple[float, ...]], more: Array, at: Array
) -> None:
    before = frame_bound(at, np.eye(3), np.array(rows), SIGMA)
    after = frame_bound(at, np.eye(3), np.array([*rows, more]), SIGMA)
    for fewer, with_more in zip(before, after, strict=True):
        # A nearly undetermined one depends on rounding.
        if fewer < 1e3 * SIGMA:
            assert with_more <= fewer * (1.0 + 1e-6)


@pytest.mark.parametrize(
    ("beacons", "at"),
    [
        (PAPER_BEACONS.positions_w[:3], (0.0, 0.0, 1.0)),
        (np.zeros((0, 3)), (0.0, 0.0, 1.0)),
        ([(float(k), 0.0, 0.1) for k in range(4)], (0.5, 0.0, 1.0)),  # on one line
        ([(1.0, 1.0, 0.1)] * 4, (0.0, 0.0, 1.0)),  # on one spot
        (PAPER_BEACONS.positions_w, (1.0, 1.0, 0.1)),  # in a beacon
        (PAPER_BEACONS.positions_w, (math.nan, 0.0, 1.0)),
    ],
)
def test_what_is_not_determined_is_not_a_number(beacons: Array, at: tuple[float, ...]) -> None:
    position, attitude = frame_bound(at, np.eye(3), beacons, SIGMA)
    assert math.isnan(position)
    assert math.isnan(attitude)


@pytest.mark.parametrize("name", PRESETS)
def test_the_map_is_the_bound_of_each_of_its_points(name: str) -> None:
    found = bound_map(PRESETS[name], SIGMA, (-3.0, 3.0), (-2.0, 1.0), 1.3, spacing=0.31)
    assert found.position.shape == (len(found.y), len(found.x)) == (10, 20)
    for j, y in enumerate(found.y.tolist()):
        for i, x in enumerate(found.x.tolist()):
            alone, _ = frame_bound((x, y, 1.3), np.eye(3), PRESETS[name].positions_w, SIGMA)
            assert found.position[j, i] == pytest.approx(alone, rel=1e-9, nan_ok=True)


def test_its_points_are_the_middles_of_cells_that_fill_the_slice() -> None:
    found = bound_map(PAPER_BEACONS, SIGMA, (-3.0, 3.0), (0.0, 1.0), 1.0, spacing=0.25)
    np.testing.assert_allclose(found.x[[0, -1]], (-2.875, 2.875))
    np.testing.assert_allclose(found.y, (0.125, 0.375, 0.625, 0.875))


def test_a_slice_too_large_is_coarser() -> None:
    found = bound_map(PAPER_BEACONS, SIGMA, (-500.0, 500.0), (-250.0, 250.0), 1.0)
    assert 0.98 * LARGEST_MAP < found.position.size < 1.02 * LARGEST_MAP


SIGHTS = [
    {},
    {"range_max": 2.2},
    {"range_min": 1.4},
    {"field_of_view": 140.0},
    {"field_of_view": 120.0, "mount_pitch": 30.0, "mount_roll": -20.0, "mount_yaw": 40.0},
    {"lost": "2"},
]


@pytest.mark.parametrize("given", SIGHTS, ids=str)
def test_it_sees_what_the_emulated_sensor_sees(given: dict[str, float | str]) -> None:
    eight = PRESETS["eight"]
    parameters = BearingParameters(layout="eight", rate=100.0, **given)  # type: ignore[arg-type]
    found = bound_map(
        eight, SIGMA, (-1.5, 1.5), (-1.5, 1.5), 1.0, sight=FieldOfView.of(parameters), spacing=0.3
    )
    some_seen = False
    for j, y in enumerate(found.y.tolist()):
        for i, x in enumerate(found.x.tolist()):
            emulator, r = BearingEmulator(parameters), np.array([x, y, 1.0])
            for k in (1, 2):
                emulator.observe(k * 10_000_000, r, np.array([1.0, 0.0, 0.0, 0.0]))
            frame = emulator.due(10**12)[-1]
            ids = frame.beacon_ids.tolist()
            seen = [k for k, id in enumerate(eight.ids.tolist()) if id in ids]
            alone, _ = frame_bound(r, np.eye(3), eight.positions_w[seen], SIGMA)
            assert found.position[j, i] == pytest.approx(alone, rel=1e-9, nan_ok=True)
            some_seen |= math.isfinite(alone)
    assert some_seen


def test_with_every_beacon_dark_nothing_is_determined() -> None:
    dark = replace(FieldOfView(), lost=None)
    found = bound_map(PAPER_BEACONS, SIGMA, (-1.0, 1.0), (-1.0, 1.0), 1.0, sight=dark)
    assert np.isnan(found.position).all()
    one = bound_map(
        Beacons([1, 2, 3, 4], PAPER_BEACONS.positions_w),
        SIGMA,
        (-1.0, 1.0),
        (-1.0, 1.0),
        1.0,
        sight=replace(FieldOfView(), lost=frozenset({3})),
    )
    assert np.isnan(one.position).all()
