"""Emulated bearings: geometry exact without noise, noise as described with it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from bearing_sim import (
    PAPER_BEACONS,
    Beacons,
    BearingEmulator,
    BearingMeasurement,
    BearingParameters,
)
from bearing_sim.emulator import perturbed
from bearing_sim.quaternions import matrix_of, turned

Array = npt.NDArray[np.float64]
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def frame(parameters: BearingParameters, position: Array, quaternion: Array) -> BearingMeasurement:
    emulator = BearingEmulator(parameters)
    emulator.observe(0, position, quaternion)
    [measurement] = emulator.due(0)
    return measurement


def random_quaternion(random: np.random.Generator) -> Array:
    q = random.standard_normal(4)
    return np.asarray(q / np.linalg.norm(q))


def test_the_papers_beacons_form_a_square_of_two_metres_ten_centimetres_up() -> None:
    positions = PAPER_BEACONS.positions_w
    np.testing.assert_array_equal(positions[:, 2], 0.1)
    sides = np.linalg.norm(positions - np.roll(positions, 1, axis=0), axis=1)
    np.testing.assert_array_equal(sides, 2.0)


def test_without_noise_a_bearing_points_from_the_body_to_its_beacon() -> None:
    seed = 5
    random = np.random.default_rng(seed)
    for _ in range(20):
        position, q = random.uniform([-1, -1, 0.5], [1, 1, 2.5]), random_quaternion(random)
        measured = frame(BearingParameters(sigma=0.0), position, q)
        in_world = measured.bearings_b @ matrix_of(q).T
        distance = np.linalg.norm(PAPER_BEACONS.positions_w - position, axis=1)
        np.testing.assert_allclose(
            position + distance[:, None] * in_world,
            PAPER_BEACONS.positions_w,
            atol=1e-12,
            err_msg=f"seed {seed}",
        )
        assert list(measured.beacon_ids) == [1, 2, 3, 4]


def test_a_yawed_vehicle_sees_a_beacon_ahead_of_the_world_on_its_right() -> None:
    quarter = turned(LEVEL, np.array([0.0, 0.0, np.pi / 2]))  # nose to +y, world x to its right
    emulator = BearingEmulator(
        BearingParameters(sigma=0.0), Beacons(np.array([9], np.int32), np.array([[2.0, 0, 0]]))
    )
    emulator.observe(0, np.zeros(3), quarter)
    [measured] = emulator.due(0)
    np.testing.assert_allclose(measured.bearings_b, [[0.0, -1.0, 0.0]], atol=1e-12)


def test_the_noise_has_its_sigma_on_both_tangent_axes_and_keeps_unit_length() -> None:
    seed, sigma = 8, np.radians(1.5)
    angles = sigma * np.random.default_rng(seed).standard_normal((20000, 2))
    for bearing in np.array([[0.0, 0, 1], [0.6, 0, -0.8], [1, 0, 0]]):
        x, y, z = bearing
        moved = np.array([perturbed((x, y, z), *pair) for pair in angles])
        np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 1.0, atol=1e-12)
        away = np.arccos(np.clip(moved @ bearing, -1, 1))
        np.testing.assert_allclose(away, np.linalg.norm(angles, axis=1), atol=1e-7)
        spread = np.cov((moved - (moved @ bearing)[:, None] * bearing).T)
        variances = np.sort(np.linalg.eigvalsh(spread))
        np.testing.assert_allclose(variances[1:], sigma**2, rtol=0.05, err_msg=f"seed {seed}")
        assert variances[0] == pytest.approx(0, abs=1e-12)


def test_the_same_seed_gives_the_same_bearings_and_another_does_not() -> None:
    position = np.array([0.1, 0.2, 1.0])
    one, two, other = (
        frame(BearingParameters(seed=s), position, LEVEL).bearings_b for s in (4, 4, 5)
    )
    np.testing.assert_array_equal(one, two)
    assert not np.allclose(one, other)


def test_frames_come_at_the_rate_and_late_by_the_delay() -> None:
    emulator = BearingEmulator(BearingParameters(rate=30.0, delay=0.05))
    for k in range(1000):
        emulator.observe(k * 10_000_000, np.array([0, 0, 1.0]), LEVEL)
    assert len(emulator.due(10_000_000_000 + 49_000_000 - 10_000_000)) == pytest.approx(300, abs=1)
    emulator.observe(10_020_000_000, np.array([0, 0, 1.0]), LEVEL)
    emulator.due(10_069_000_000)
    assert [m.stamp_ns for m in emulator.due(10_070_000_000)] in ([10_020_000_000], [])


def test_a_narrow_field_of_view_sees_only_what_is_below() -> None:
    low = frame(BearingParameters(field_of_view=90.0), np.array([1.0, 1.0, 1.0]), LEVEL)
    assert list(low.beacon_ids) == [1]
    high = frame(BearingParameters(field_of_view=90.0), np.array([0.0, 0.0, 3.0]), LEVEL)
    assert list(high.beacon_ids) == [1, 2, 3, 4]


def test_what_is_out_of_range_or_at_the_camera_itself_is_not_seen() -> None:
    position = np.array([1.0, 1.0, 0.1])
    near = frame(BearingParameters(range_max=2.5), position, LEVEL)
    assert list(near.beacon_ids) == [2, 4]
    assert np.all(np.isfinite(near.bearings_b))


def test_drop_outs_take_their_share_and_leave_the_noise_of_the_others() -> None:
    position, seed = np.array([0.1, 0.2, 1.0]), 3
    whole, some = (BearingEmulator(BearingParameters(drop_out=d, seed=seed)) for d in (0.0, 0.25))
    for k in range(1000):
        whole.observe(k * 100_000_000, position, LEVEL)
        some.observe(k * 100_000_000, position, LEVEL)
    all_frames, kept_frames = whole.due(10**12), some.due(10**12)
    share = 1 - sum(len(f.beacon_ids) for f in kept_frames) / 4000
    assert share == pytest.approx(0.25, abs=0.03), f"seed {seed}"
    for a, b in zip(all_frames, kept_frames, strict=True):
        np.testing.assert_array_equal(a.bearings_b[b.beacon_ids - 1], b.bearings_b)


def test_swaps_exchange_two_identities_only() -> None:
    measured = frame(BearingParameters(swap=1.0, sigma=0.0), np.array([0.1, 0.2, 1]), LEVEL)
    assert sorted(measured.beacon_ids) == [1, 2, 3, 4]
    assert np.count_nonzero(measured.beacon_ids != [1, 2, 3, 4]) == 2


def test_the_sigma_told_is_the_noise_in_radians_and_never_zero() -> None:
    position = np.array([0.1, 0.2, 1.0])
    assert frame(BearingParameters(), position, LEVEL).sigma == pytest.approx(1.5 * np.pi / 180)
    assert frame(BearingParameters(sigma=0.0), position, LEVEL).sigma > 0
