"""Pose at an instant between two poses, against motions known in closed form."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bearing_sim.pose_track import GAP_NS, PoseTrack, slerp
from bearing_sim.sampling import SECOND_NS, InstantGrid
from quadrotor.plain_rotations import turned
from quadrotor.records import Array

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
MS = 1_000_000


def eight(time: float) -> Array:
    """Return an 8 of 1 m in 8 s with 0.2 m of height; m."""
    phase = 2 * math.pi * time / 8.0
    return np.array([0.5 * math.sin(2 * phase), 0.5 * math.sin(phase), 1 + 0.1 * math.sin(phase)])


def worst(spacing_ns: int) -> float:
    """Return the largest error (m) of the interpolated 8 at 30 Hz, after three poses."""
    track, grid, largest, before_ns = PoseTrack(), InstantGrid(), 0.0, -1
    for stamp_ns in range(0, 8 * SECOND_NS, spacing_ns):
        track.add(stamp_ns, eight(stamp_ns * 1e-9), LEVEL)
        for instant_ns in grid.between(before_ns, stamp_ns, 30.0):
            if stamp_ns > 2 * spacing_ns:
                away = track.at(instant_ns).position_w - eight(instant_ns * 1e-9)
                largest = max(largest, float(np.linalg.norm(away)))
        before_ns = stamp_ns
    return largest


@pytest.mark.parametrize("spacing_ns", [4 * MS, 9_700_000, 23 * MS, 47 * MS])
def test_position_on_an_eight_is_as_near_as_its_jerk_allows(spacing_ns: int) -> None:
    jerk = 0.5 * (4 * math.pi / 8.0) ** 3 * math.sqrt(2)
    assert worst(spacing_ns) < 0.065 * jerk * (spacing_ns * 1e-9) ** 3 + 1e-12


def test_position_is_exact_on_a_parabola_whatever_the_spacing(rng: np.random.Generator) -> None:
    p, v, a = rng.standard_normal((3, 3))

    def at(time: float) -> Array:
        return np.asarray(p + v * time + a * time * time)

    track, stamp_ns = PoseTrack(), 0
    for k, step_ns in enumerate(rng.integers(15 * MS, 30 * MS, 50).tolist()):
        before_ns, stamp_ns = stamp_ns, stamp_ns + step_ns
        track.add(stamp_ns, at(stamp_ns * 1e-9), LEVEL)
        if k >= 2:
            instant_ns = int(rng.integers(before_ns + 1, stamp_ns))
            np.testing.assert_allclose(
                track.at(instant_ns).position_w, at(instant_ns * 1e-9), atol=1e-12
            )


def test_attitude_of_a_steady_turn_is_exact(rng: np.random.Generator) -> None:
    omega_b, start = rng.normal(0, 2, 3), turned(LEVEL, (rng.standard_normal(3)).tolist())
    track = PoseTrack()
    for stamp_ns in range(0, SECOND_NS, 10 * MS):
        track.add(stamp_ns, np.zeros(3), turned(start, (omega_b * stamp_ns * 1e-9).tolist()))
        if stamp_ns:
            instant_ns = stamp_ns - 3_700_000
            found = np.array(track.at(instant_ns).quaternion_wb)
            expected = turned(start, (omega_b * instant_ns * 1e-9).tolist())
            assert abs(found @ expected) == pytest.approx(1.0, abs=1e-14)


def test_attitude_of_an_accelerated_turn_is_as_near_as_its_acceleration_allows() -> None:
    spacing_ns, acceleration = 10 * MS, 5.0
    track = PoseTrack()
    for stamp_ns in range(0, SECOND_NS, spacing_ns):
        angle = 0.5 * acceleration * (stamp_ns * 1e-9) ** 2
        track.add(stamp_ns, np.zeros(3), turned(LEVEL, [0.0, angle, 0.0]))
        if stamp_ns:
            instant_ns = stamp_ns - spacing_ns // 2
            found = 2 * math.asin(track.at(instant_ns).quaternion_wb[2])
            expected = 0.5 * acceleration * (instant_ns * 1e-9) ** 2
            assert abs(found - expected) < acceleration * (spacing_ns * 1e-9) ** 2 / 8 * 1.001


unit = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: math.hypot(*q) > 0.1)


@given(unit, unit, st.floats(0, 1))
def test_slerp_is_a_share_of_the_shorter_arc(
    a: tuple[float, float, float, float], b: tuple[float, float, float, float], share: float
) -> None:
    p, q = (tuple(x / math.hypot(*one) for x in one) for one in (a, b))
    found = slerp(p, q, share)  # type: ignore[arg-type]
    assert math.hypot(*found) == pytest.approx(1.0, abs=1e-12)
    whole = 2 * math.acos(min(1.0, abs(float(np.dot(p, q)))))
    if abs(whole - math.pi) > 1e-6:
        part = 2 * math.acos(min(1.0, abs(float(np.dot(p, found)))))
        assert part == pytest.approx(share * whole, abs=1e-6)
    if np.dot(p, q) != 0.0:  # q and -q are one attitude
        opposite = tuple(-x for x in q)
        np.testing.assert_array_equal(slerp(p, opposite, share), found)  # type: ignore[arg-type]


def test_a_pose_asked_for_at_its_own_stamp_is_the_pose() -> None:
    track = PoseTrack()
    for k in range(4):
        track.add(k * 10 * MS, np.array([k * k, 1.0, 2.0]), LEVEL)
        assert track.at(k * 10 * MS).position_w == (k * k, 1.0, 2.0)


def test_poses_that_came_close_together_do_not_bend_the_next_interval() -> None:
    """1 mm of noise over 1 ms would be a curvature of metres."""
    track = PoseTrack()
    for stamp_ns, x in ((0, 0.0), (1 * MS, 0.001), (90 * MS, 0.0)):
        track.add(stamp_ns, np.array([x, 0.0, 1.0]), LEVEL)
    assert 0.0 < track.at(45 * MS).position_w[0] < 0.001


def test_what_add_allows_to_be_asked_for() -> None:
    track, here = PoseTrack(), np.zeros(3)
    assert track.add(1000, here, LEVEL) == 999  # the first: itself only
    assert track.add(1000 + GAP_NS, here, LEVEL) == 1000
    assert track.add(1000 + GAP_NS, here, LEVEL) is None  # not newer
    assert track.add(5000, here, LEVEL) is None
    assert track.add(2001 + 2 * GAP_NS, here, LEVEL) == 2000 + 2 * GAP_NS  # after a gap: itself
    assert track.add(2500 + 2 * GAP_NS, here, LEVEL) == 2001 + 2 * GAP_NS
    assert not track.went_back(2500 + GAP_NS)
    assert track.went_back(2499 + GAP_NS)


# ------------------------------------------------------------------ the grid of instants
@pytest.mark.parametrize("rate", [1.0, 7.0, 29.97, 30.0, 33.3, 60.0, 119.88, 120.0])
def test_instants_do_not_drift_within_a_day_of_the_epochs_clock(rate: float) -> None:
    grid, day_ns = InstantGrid(), 86_400 * SECOND_NS
    for begin_ns in (0, 1_760_000_000 * SECOND_NS):
        late_ns = begin_ns + day_ns
        found = list(grid.between(late_ns - 1, late_ns + SECOND_NS - 1, rate))
        assert len(found) in (math.floor(rate), math.ceil(rate))
        for instant_ns in found:
            # In integers: k/rate to half a nanosecond.
            millihertz, scale = round(rate * 1000), 1000 * SECOND_NS
            k = (instant_ns * millihertz + scale // 2) // scale
            assert 2 * abs(k * scale - instant_ns * millihertz) <= millihertz


@given(st.lists(st.integers(0, 10 * SECOND_NS), max_size=30), st.floats(1, 120))
def test_instants_are_the_same_however_the_time_is_cut(cuts: list[int], rate: float) -> None:
    grid = InstantGrid()
    whole = list(grid.between(-1, 10 * SECOND_NS, rate))
    edges = [-1, *sorted(cuts), 10 * SECOND_NS]
    parts = [t for a, b in itertools.pairwise(edges) for t in grid.between(a, b, rate)]
    assert parts == whole
    assert len(whole) == pytest.approx(10 * rate, abs=1.01)
