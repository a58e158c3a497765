"""Emulated bearings: geometry exact without noise, and the effect of each parameter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest

from bearing_sim import PAPER_BEACONS, BearingEmulator, BearingMeasurement, BearingParameters
from bearing_sim.bearing_parameters import parse_lost
from quadrotor.errors import OutOfBoundsError, ParameterError
from quadrotor.parameters import ParameterStore
from quadrotor.plain_rotations import matrix_of, turned
from quadrotor.records import Array

Motion = Callable[[float], tuple[Array, Array]]
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
MS, SECOND = 1_000_000, 1_000_000_000
EVERY_10_MS = range(0, 10 * SECOND + 1, 10 * MS)


def asked(**values: Any) -> BearingParameters:
    """Return parameters without noise by default: a sensor cannot be set to claim exactness."""
    return BearingParameters.model_construct(**{"sigma": 0.0, **values})


def one_frame(position: Any, quaternion: Array = LEVEL, **values: Any) -> BearingMeasurement:
    emulator = BearingEmulator(asked(**values))
    emulator.observe(0, np.array(position, dtype=float), quaternion)
    [frame] = emulator.due(2 * SECOND)
    return frame


def fly(
    motion: Motion, stamps_ns: Iterable[int], parameters: BearingParameters
) -> list[BearingMeasurement]:
    """Return all frames seen along a motion whose poses arrive at these stamps."""
    emulator = BearingEmulator(parameters)
    frames: list[BearingMeasurement] = []
    for stamp_ns in stamps_ns:
        emulator.observe(stamp_ns, *motion(stamp_ns * 1e-9))
        frames += emulator.due(stamp_ns)
    return frames + emulator.due(2**62)


def hover(_time: float) -> tuple[Array, Array]:
    return np.array([0.1, 0.2, 1.0]), LEVEL


def swing(time: float) -> tuple[Array, Array]:
    """Return a pose that is smooth in position and attitude."""
    place = np.array([0.5 * math.sin(time), 0.5 * math.cos(1.3 * time), 1 + 0.1 * math.sin(time)])
    return place, turned(LEVEL, [0.2 * math.sin(time), 0.1 * math.cos(time), 0.5 * time])


def rays(position: Array, quaternion: Array) -> Array:
    """Return exact bearings to the paper's beacons, body axes, (4, 3)."""
    away = (PAPER_BEACONS.positions_w - position) @ matrix_of(quaternion)
    return np.asarray(away / np.linalg.norm(away, axis=1)[:, None])


def same(one: list[BearingMeasurement], other: list[BearingMeasurement]) -> bool:
    return len(one) == len(other) and all(
        a.stamp_ns == b.stamp_ns
        and np.array_equal(a.beacon_ids, b.beacon_ids)
        and np.array_equal(a.bearings_b, b.bearings_b)
        for a, b in zip(one, other, strict=True)
    )


# ------------------------------------------------------------------ geometry
def test_without_noise_a_bearing_points_from_the_body_to_its_beacon(
    rng: np.random.Generator,
) -> None:
    for _ in range(20):
        position, q = rng.uniform([-1, -1, 0.5], [1, 1, 2.5]), rng.standard_normal(4)
        q /= np.linalg.norm(q)
        measured = one_frame(position, q)
        in_world = measured.bearings_b @ matrix_of(q).T
        distance = np.linalg.norm(PAPER_BEACONS.positions_w - position, axis=1)
        np.testing.assert_allclose(
            position + distance[:, None] * in_world, PAPER_BEACONS.positions_w, atol=1e-12
        )
        assert list(measured.beacon_ids) == [1, 2, 3, 4]


def test_a_yawed_vehicle_sees_a_beacon_ahead_of_the_world_on_its_right() -> None:
    quarter = turned(LEVEL, [0.0, 0.0, np.pi / 2])  # nose to +y, world x to its right
    measured = one_frame([0, 0, 0], quarter, layout="9 2 0 0; 8 0 2 0; 7 -2 0 0; 6 0 -2 0")
    assert list(measured.beacon_ids) == [9, 8, 7, 6]
    np.testing.assert_allclose(
        measured.bearings_b, [[0, -1, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0]], atol=1e-12
    )


# ------------------------------------------------------------------ instants
@pytest.mark.parametrize("rate", [1.0, 12.5, 30.0, 60.0, 120.0])
def test_frames_are_taken_at_the_sensors_own_instants(rate: float) -> None:
    frames = fly(swing, EVERY_10_MS, asked(rate=rate))
    assert [f.stamp_ns for f in frames] == [round(k * SECOND / rate) for k in range(len(frames))]
    assert len(frames) == 10 * rate + 1
    for frame in frames[3:]:  # three poses are available
        position, q = swing(frame.stamp_ns * 1e-9)
        np.testing.assert_allclose(frame.bearings_b, rays(position, q), atol=2e-5)


def test_the_rate_is_kept_over_minutes_of_irregular_poses(rng: np.random.Generator) -> None:
    stamps = np.cumsum(rng.integers(2 * MS, 40 * MS, 6000)).tolist()
    frames = fly(hover, stamps, asked(rate=29.97))
    seen = (frames[-1].stamp_ns - frames[0].stamp_ns) * 1e-9
    assert seen > 100
    assert (len(frames) - 1) / seen == pytest.approx(29.97, rel=1e-6)


def test_a_frame_comes_with_the_first_pose_at_or_after_its_instant() -> None:
    emulator = BearingEmulator(asked(rate=30.0))
    came: dict[int, int] = {}
    for stamp_ns in range(0, 100 * MS, 10 * MS):
        emulator.observe(stamp_ns, *hover(0))
        came |= {f.stamp_ns: stamp_ns for f in emulator.due(stamp_ns)}
    assert came == {0: 0, 33_333_333: 40 * MS, 66_666_667: 70 * MS}


def test_slow_poses_give_several_frames_at_once() -> None:
    emulator = BearingEmulator(asked(rate=120.0))
    for stamp_ns in (0, 50 * MS, 100 * MS):
        emulator.observe(stamp_ns, *swing(stamp_ns * 1e-9))
    assert len(emulator.due(100 * MS)) == 13


def test_there_are_no_frames_in_a_gap_of_the_poses() -> None:
    stamps = [t for t in EVERY_10_MS if not 2 * SECOND < t < 2_110 * MS]
    found = {f.stamp_ns for f in fly(swing, stamps, asked())}
    whole = {f.stamp_ns for f in fly(swing, EVERY_10_MS, asked())}
    assert found < whole
    assert {t for t in whole if not 2 * SECOND < t < 2_110 * MS} == found
    shorter = [t for t in EVERY_10_MS if not 2 * SECOND < t < 2_100 * MS]
    assert {f.stamp_ns for f in fly(swing, shorter, asked())} == whole


def test_a_restarted_source_is_followed_and_what_was_under_way_is_lost() -> None:
    emulator = BearingEmulator(asked(delay=0.2))
    for stamp_ns in range(50 * SECOND, 51 * SECOND, 10 * MS):
        emulator.observe(stamp_ns, *hover(0))
    emulator.observe(0, *hover(0))
    assert [f.stamp_ns for f in emulator.due(100 * SECOND)] == [0]


def test_poses_out_of_order_or_twice_change_nothing() -> None:
    shuffled = [t for s in range(0, 10 * SECOND, 20 * MS) for t in (s, s - 5 * MS, s, s + 10 * MS)]
    assert same(
        fly(swing, shuffled, BearingParameters()),
        fly(swing, [t for t in shuffled if t % (10 * MS) == 0], BearingParameters()),
    )


def test_a_new_rate_acts_at_the_next_instant_and_none_comes_twice() -> None:
    parameters = asked(rate=30.0)
    emulator = BearingEmulator(parameters)
    for stamp_ns in EVERY_10_MS:
        parameters.rate = 30.0 if stamp_ns <= 5 * SECOND else 50.0
        emulator.observe(stamp_ns, *hover(0))
    stamps = [f.stamp_ns for f in emulator.due(2**62)]
    assert stamps == sorted(set(stamps))
    assert len(stamps) == 150 + 1 + 250


# ------------------------------------------------------------------ the same again
def test_the_same_seed_gives_the_same_bearings_and_another_does_not() -> None:
    one, two, other = (fly(swing, EVERY_10_MS, BearingParameters(seed=s)) for s in (4, 4, 5))
    assert same(one, two)
    assert not np.allclose(one[7].bearings_b, other[7].bearings_b)


def test_noise_does_not_depend_on_what_came_before_or_on_the_poses_stamps() -> None:
    whole = {f.stamp_ns: f for f in fly(hover, EVERY_10_MS, BearingParameters())}
    for stamps in (range(5 * SECOND, 6 * SECOND, 10 * MS), range(0, 10 * SECOND, 17 * MS)):
        some = fly(hover, stamps, BearingParameters())
        assert len(some) > 25
        for frame in some:
            np.testing.assert_allclose(
                frame.bearings_b, whole[frame.stamp_ns].bearings_b, atol=1e-12
            )


@pytest.mark.parametrize(
    "values",
    [
        {"drop_out": 0.25},
        {"occlusion": 0.3},
        {"range_max": 1.6},
        {"field_of_view": 110.0},
        {"lost": "2"},
        {"swap": 0.0},
        {"delay": 0.1, "jitter": 0.1},
    ],
)
def test_what_is_hidden_leaves_the_noise_of_the_others(values: dict[str, Any]) -> None:
    whole = fly(swing, EVERY_10_MS, BearingParameters())
    some = fly(swing, EVERY_10_MS, BearingParameters(**values))
    for a, b in zip(whole, some, strict=True):
        np.testing.assert_array_equal(a.bearings_b[b.beacon_ids - 1], b.bearings_b)
    if values.keys() & {"drop_out", "occlusion", "range_max", "field_of_view", "lost"}:
        assert sum(len(f.beacon_ids) for f in some) < 0.95 * 4 * len(whole)


# ------------------------------------------------------------------ each parameter
def test_a_narrow_field_of_view_sees_only_what_is_below() -> None:
    low = one_frame([1, 1, 1], field_of_view=90.0)
    assert list(low.beacon_ids) == [1]
    assert list(one_frame([0, 0, 3], field_of_view=90.0).beacon_ids) == [1, 2, 3, 4]
    assert list(one_frame([0, 0, 3], field_of_view=50.0).beacon_ids) == []


@pytest.mark.parametrize(
    ("mounting", "axis"),
    [
        ({}, (0, 0, -1)),
        ({"mount_roll": 90}, (0, 1, 0)),
        ({"mount_pitch": 90}, (-1, 0, 0)),
        ({"mount_pitch": -90}, (1, 0, 0)),
        ({"mount_pitch": -90, "mount_yaw": 90}, (0, 1, 0)),
        ({"mount_yaw": 77}, (0, 0, -1)),
        ({"mount_roll": 180}, (0, 0, 1)),
        ({"mount_roll": 45, "mount_yaw": 180}, (0, -math.sqrt(0.5), -math.sqrt(0.5))),
    ],
)
def test_the_mounting_turns_the_field_of_view_only(
    mounting: dict[str, float], axis: tuple[float, float, float]
) -> None:
    # One beacon on the axis, others of the same plane off it, around a vehicle at the origin.
    a = np.array(axis) * 2.0
    aside = np.cross(a, [0.3, 0.5, 0.8])
    aside *= 4.0 / np.linalg.norm(aside)
    other = np.cross(a, aside) / 2.0
    places = [a, a + aside, a + other, a + aside + other]
    layout = "; ".join(f"{k} {x} {y} {z}" for k, (x, y, z) in enumerate(places))
    frame = one_frame([0, 0, 0], LEVEL, layout=layout, field_of_view=20.0, **mounting)
    assert list(frame.beacon_ids) == [0]
    np.testing.assert_allclose(frame.bearings_b, [axis], atol=1e-12)


def test_a_bias_turns_all_bearings_by_one_rotation() -> None:
    position, q = swing(1.0)
    straight = one_frame(position, q)
    biased = one_frame(position, q, bias_x=3.0, bias_y=-2.0, bias_z=5.0)
    turn = matrix_of(turned(LEVEL, np.radians([3.0, -2.0, 5.0]).tolist()))
    np.testing.assert_allclose(biased.bearings_b, straight.bearings_b @ turn.T, atol=1e-12)


def test_the_bias_of_a_beacon_turns_its_bearings_alone() -> None:
    position, q = swing(1.3)
    plain = one_frame(position, q)
    biased = one_frame(position, q, beacon_bias="2 3 -2 5; 4 0 0 1; 99 1 1 1")
    for id, one, other in zip(plain.beacon_ids, plain.bearings_b, biased.bearings_b, strict=True):
        vector = {2: (3.0, -2.0, 5.0), 4: (0.0, 0.0, 1.0)}.get(int(id), (0.0, 0.0, 0.0))
        turn = matrix_of(turned(LEVEL, np.radians(vector).tolist()))
        np.testing.assert_allclose(other, turn @ one, atol=1e-12)


@pytest.mark.parametrize(
    "text", ["2", "2 1 1", "two 1 1 1", "2 1 1 nan", "2 21 0 0", "2 1 0 0; 2 0 1 0", "-1 1 1 1"]
)
def test_a_text_that_is_no_bias_of_beacons_is_refused(text: str) -> None:
    with pytest.raises(OutOfBoundsError, match="beacon_bias"):
        BearingParameters(beacon_bias=text)


def test_an_error_of_the_stamps_moves_nothing_else() -> None:
    plain, early = (fly(hover, EVERY_10_MS, asked(stamp_error=e)) for e in (0.0, -0.02))
    assert [b.stamp_ns - a.stamp_ns for a, b in zip(plain, early, strict=True)] == (
        [-20_000_000] * len(plain)
    )
    for a, b in zip(plain, early, strict=True):
        np.testing.assert_array_equal(a.bearings_b, b.bearings_b)


def test_what_is_too_near_or_too_far_is_not_seen() -> None:
    at_a_beacon = [1.0, 1.0, 0.1]
    near = one_frame(at_a_beacon, range_max=2.5)
    assert list(near.beacon_ids) == [2, 4]
    assert np.all(np.isfinite(near.bearings_b))
    assert list(one_frame(at_a_beacon, range_min=2.5).beacon_ids) == [3]
    assert list(one_frame(at_a_beacon, range_min=5, range_max=4).beacon_ids) == []


def test_drop_outs_take_their_share_of_single_bearings(seed: int) -> None:
    frames = fly(hover, EVERY_10_MS, BearingParameters(rate=100.0, drop_out=0.25, seed=seed))
    seen = np.array([len(f.beacon_ids) for f in frames])
    assert 1 - seen.mean() / 4 == pytest.approx(0.25, abs=0.03)
    # Beacons are independent of each other: the count of a frame is binomial.
    assert seen.var() == pytest.approx(4 * 0.25 * 0.75, rel=0.15)
    assert list(one_frame([0, 0, 1], drop_out=1.0).beacon_ids) == []


def test_occlusion_hides_a_beacon_for_a_spell() -> None:
    frames = fly(hover, EVERY_10_MS, asked(rate=100.0, occlusion=0.3, occlusion_spell=1.0))
    for id in (1, 2, 3, 4):
        seen = np.array([id in f.beacon_ids for f in frames])
        changes = int(np.count_nonzero(np.diff(seen)))
        assert 2 <= changes <= 8
        assert 1 - seen.mean() == pytest.approx(0.3, abs=0.1)


def test_swaps_exchange_two_identities_in_their_share_of_the_frames(seed: int) -> None:
    always = fly(hover, EVERY_10_MS, asked(swap=1.0))
    pairs = set()
    for frame in always:
        assert sorted(frame.beacon_ids) == [1, 2, 3, 4]
        moved = np.flatnonzero(frame.beacon_ids != [1, 2, 3, 4])
        assert len(moved) == 2
        pairs.add(tuple(moved.tolist()))
        np.testing.assert_array_equal(frame.bearings_b, rays(*hover(0)))
    assert len(pairs) == 6
    some = fly(hover, EVERY_10_MS, asked(rate=100.0, swap=0.2, seed=seed))
    share = np.mean([list(f.beacon_ids) != [1, 2, 3, 4] for f in some])
    assert share == pytest.approx(0.2, abs=0.04)


@pytest.mark.parametrize(
    ("lost", "seen"),
    [("", [1, 2, 3, 4]), ("2", [1, 3, 4]), ("4, 1", [2, 3]), ("all", []), ("9", [1, 2, 3, 4])],
)
def test_lost_beacons_are_dark_and_come_back(lost: str, seen: list[int]) -> None:
    parameters = asked(lost=lost)
    emulator = BearingEmulator(parameters)
    emulator.observe(0, *hover(0))
    parameters.lost = ""
    emulator.observe(40 * MS, *hover(0))
    first, second = emulator.due(SECOND)
    assert list(first.beacon_ids) == seen
    assert first.bearings_b.shape == (len(seen), 3)
    assert list(second.beacon_ids) == [1, 2, 3, 4]


def test_the_delay_and_the_jitter_put_off_the_arrival_and_keep_the_order(seed: int) -> None:
    emulator = BearingEmulator(asked(rate=100.0, delay=0.05, jitter=0.03, seed=seed))
    for stamp_ns in range(0, 20 * SECOND, 10 * MS):
        emulator.observe(stamp_ns, *hover(0))
    late, stamps, now_ns = [], [], 0
    while (next_ns := emulator.next_ns) is not None:
        now_ns = max(now_ns, next_ns)  # one that was due earlier waits for the one ahead
        for frame in emulator.due(now_ns):
            late.append((now_ns - frame.stamp_ns) / MS)
            stamps.append(frame.stamp_ns)
    assert stamps == list(range(0, 20 * SECOND, 10 * MS))
    assert min(late) >= 50
    assert max(late) <= 80
    assert np.std(late) > 3


def test_a_delayed_frame_keeps_the_stamp_of_its_instant() -> None:
    emulator = BearingEmulator(asked(delay=0.15))
    emulator.observe(SECOND, *hover(0))
    assert emulator.next_ns == SECOND + 150 * MS
    assert emulator.due(SECOND + 150 * MS - 1) == []
    assert [f.stamp_ns for f in emulator.due(SECOND + 150 * MS)] == [SECOND]
    assert emulator.next_ns is None


def test_the_sigma_told_is_that_of_the_noise_in_radians() -> None:
    for sigma in (0.05, 1.5, 20.0):
        [first, *_] = fly(hover, [0], BearingParameters(sigma=sigma))
        assert first.sigma == pytest.approx(sigma * np.pi / 180)


def test_a_new_layout_acts_at_the_next_frame() -> None:
    parameters = asked()
    emulator = BearingEmulator(parameters)
    emulator.observe(0, *hover(0))
    parameters.layout = "eight"
    assert len(emulator.beacons) == 8
    emulator.observe(50 * MS, *hover(0))
    first, second = emulator.due(SECOND)
    assert (len(first.beacon_ids), len(second.beacon_ids)) == (4, 8)


# ------------------------------------------------------------------ refusals
@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("sigma", 0.0, "allowed 0.05 to 20 °"),
        ("sigma", -1.0, "allowed 0.05 to 20 °"),
        ("sigma", math.nan, "not a finite number"),
        ("rate", 0.5, "allowed 1 to 120 Hz"),
        ("rate", 121.0, "allowed 1 to 120 Hz"),
        ("degrees_of_freedom", 2.0, "allowed 2.1 to 100"),
        ("distribution", "cauchy", "is not one of gaussian, student_t"),
        ("drop_out", 1.1, "allowed 0 to 1"),
        ("layout", "1 0 0 0; 2 1 0 0; 3 2 0 0", "3 beacons; allowed are 4 to 32"),
        ("layout", "1 0 0 0; 2 1 0 0; 3 2 0 0; 4 3 0 0", "one line or at one point"),
        ("layout", "1 0 0 0; 1 1 0 0; 3 1 1 0; 4 0 1 0", "more than once"),
        ("layout", "squar", "neither a preset"),
        ("layout", 3, "must be text"),
        ("lost", "one", "lost = 'one' names no beacons"),
        ("lost", "-1", "allowed are ids 0 to 2147483647"),
        ("lost", "all 1", "names no beacons"),
    ],
)
def test_a_bad_value_is_refused_with_the_reason_and_changes_nothing(
    name: str, value: Any, says: str
) -> None:
    parameters = BearingParameters()
    store, before = ParameterStore(parameters), parameters.model_copy()
    emulator = BearingEmulator(parameters)
    with pytest.raises(ParameterError, match=says):
        store.set({name: value})
    assert parameters == before
    emulator.observe(0, *hover(0))
    assert len(emulator.due(0)[0].beacon_ids) == 4


def test_every_parameter_has_bounds_or_choices_and_says_what_it_is() -> None:
    for description in ParameterStore(BearingParameters()).descriptions():
        assert description.description
        if description.type in ("float", "int"):
            assert description.minimum is not None
            assert description.maximum is not None
            assert description.step


def test_lost_ids_are_read_from_text() -> None:
    assert parse_lost("") == parse_lost("  ") == frozenset()
    assert parse_lost("1, 3 2") == frozenset({1, 2, 3})
    assert parse_lost("all") is None
