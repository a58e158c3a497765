"""Figures of the watch, and the time of its verdict."""

from __future__ import annotations

import math
import zlib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bearing_sim.beacons import PAPER_BEACONS
from bearing_sim.emulator import perturbed
from estimation.convergence import Deviations, Difference
from quadrotor.records import BEARINGS_SAMPLE, Record, new_state
from tests.support.narrowing import now
from vehicle.estimators.bearings_watch import (
    FEWEST_FRAMES,
    IN_A_ROW,
    BearingsWatch,
    normalised_squares,
)
from vehicle.parameters import FallBackParameters

SIGMA = math.radians(1.5)
SURE = Deviations(position=1e-6, velocity=1e-6, attitude=1e-6)
PLACES = PAPER_BEACONS.positions_w
Random = np.random.Generator


@pytest.fixture
def random(request: pytest.FixtureRequest) -> Random:
    seed = zlib.crc32(request.node.name.encode())
    print(f"seed {seed}")
    return np.random.default_rng(seed)


def seen(state: Record, random: Random, sigma: float = SIGMA) -> np.ndarray:
    w, x, y, z = state["quaternion_wb"][0]
    away = Rotation.from_quat([x, y, z, w]).inv().apply(PLACES - state["position_w"][0])
    away /= np.linalg.norm(away, axis=1)[:, None]
    return np.array([perturbed(tuple(d), *(sigma * random.normal(size=2))) for d in away.tolist()])


def frame_of(stamp_ns: int, bearings: np.ndarray) -> Record:
    frame = np.zeros(1, BEARINGS_SAMPLE)
    frame["stamp_ns"], frame["count"], frame["sigma"] = stamp_ns, 4, SIGMA
    frame["beacon_w"][0, :4], frame["bearing_b"][0, :4] = PLACES, bearings
    return frame


def somewhere(random: Random) -> Record:
    state = new_state()
    state["position_w"][0] = random.uniform((-1.0, -1.0, 0.4), (1.0, 1.0, 2.4))
    x, y, z, w = Rotation.from_rotvec(random.normal(0, 0.7, 3)).as_quat()
    state["quaternion_wb"][0] = w, x, y, z
    return state


def test_squares_are_those_of_angles_and_have_mean_one(random: Random) -> None:
    squares = []
    for _ in range(500):
        state = somewhere(random)
        squares += normalised_squares(
            state["position_w"][0],
            state["quaternion_wb"][0],
            PLACES,
            seen(state, random),
            SIGMA,
            SURE,
        )
    assert np.mean(squares) == pytest.approx(1.0, abs=4.0 / math.sqrt(len(squares)))
    state = somewhere(random)
    exact = seen(state, random, 0.0)
    args = state["position_w"][0], state["quaternion_wb"][0], PLACES
    assert normalised_squares(*args, exact, SIGMA, SURE) == pytest.approx([0.0] * 4, abs=1e-9)
    across = np.cross(exact[0], [0.3, 0.1, 0.9])
    turned = Rotation.from_rotvec(0.1 * across / np.linalg.norm(across))
    off = normalised_squares(*args, turned.apply(exact), SIGMA, SURE)
    assert off[0] == pytest.approx(0.5 * 0.1**2 / SIGMA**2, rel=1e-3)


def test_deviations_of_the_estimate_explain_more(random: Random) -> None:
    state = somewhere(random)
    bearings = seen(state, random)
    args = state["position_w"][0], state["quaternion_wb"][0], PLACES, bearings, SIGMA
    wide = normalised_squares(*args, Deviations(0.2, 0.1, 0.05))
    assert all(a < b for a, b in zip(wide, normalised_squares(*args, SURE), strict=True))


def watched(random: Random, state: Record, frames: int, spoil: int = 0) -> BearingsWatch:
    """Return a watch after `frames` frames at 30 Hz.

    The first two bearings of `spoil` of them are exchanged.
    """
    watch = BearingsWatch(FallBackParameters())
    watch.begin()
    for k in range(frames):
        stamp_ns = 1_000_000_000 + k * 33_333_333
        watch.remember(stamp_ns, state)
        bearings = seen(state, random)
        if k < spoil:
            bearings[[0, 1]] = bearings[[1, 0]]
        watch.frame(frame_of(stamp_ns + 1000, bearings), SURE, stamp_ns + 2000)
    return watch


def test_good_frames_say_nothing(random: Random) -> None:
    watch = watched(random, somewhere(random), 300)
    assert watch.verdict is None
    assert watch.rejected == 0.0
    assert 0.5 < watch.consistency < 1.6  # 240 squares: 7 deviations about 1


def test_exchanged_bearings_are_the_ones_rejected(random: Random) -> None:
    state = new_state()
    state["position_w"][0] = 0.1, 0.2, 1.0
    watch = BearingsWatch(FallBackParameters())
    watch.begin()
    watch.remember(0, state)
    bearings = seen(state, random)
    bearings[[1, 3]] = bearings[[3, 1]]
    assert watch.frame(frame_of(0, bearings), SURE, 0) == [0, 2]


def test_a_share_of_rejected_bearings_is_told_with_its_number(random: Random) -> None:
    state = new_state()
    state["position_w"][0, 2] = 1.0
    assert watched(random, state, FEWEST_FRAMES - 1, spoil=9).verdict is None
    verdict = watched(random, state, FEWEST_FRAMES, spoil=9).verdict
    assert verdict == "50% of the bearings rejected, allowed 30%"


def test_late_frames_are_compared_with_the_estimate_of_their_time(random: Random) -> None:
    watch = BearingsWatch(FallBackParameters())
    watch.begin()
    here = somewhere(random)
    watch.remember(1_000_000, here)
    for k in range(2, 100):
        watch.remember(k * 1_000_000, somewhere(random))
    late = frame_of(1_500_000, seen(here, random))
    assert watch.frame(late, SURE, 100_000_000) == [0, 1, 2, 3]


def test_disagreement_counts_when_it_lasts() -> None:
    watch = BearingsWatch(FallBackParameters())
    far = Difference(0.35, 0.0, 0.0)
    for _ in range(IN_A_ROW - 1):
        watch.pose(far)
    watch.pose(Difference(0.25, 0.0, 0.0))
    for _ in range(IN_A_ROW - 1):
        watch.pose(far)
    assert watch.verdict is None
    watch.pose(Difference(math.nan, 0.0, 0.0))  # NaN is no agreement
    assert "allowed 0.3 m" in (now(watch).verdict or "")


def test_age_and_deviations_are_bounded_and_a_verdict_stays_until_the_next_begin(
    random: Random,
) -> None:
    watch = BearingsWatch(FallBackParameters())
    watch.age(0.49)
    assert watch.verdict is None
    watch.age(0.51)
    assert now(watch).verdict == "no frame of bearings applied for 0.51 s"
    watch.age(0.0)
    assert now(watch).verdict is not None
    watch.begin()
    assert watch.verdict is None
    state = somewhere(random)
    watch.remember(0, state)
    watch.frame(frame_of(0, seen(state, random)), Deviations(0.31, 0.1, 0.01), 0)
    assert "deviations 0.310 m" in (now(watch).verdict or "")


def test_switched_off_it_neither_speaks_nor_rejects(random: Random) -> None:
    watch = BearingsWatch(FallBackParameters(enabled=False))
    state = somewhere(random)
    watch.remember(0, state)
    wrong = frame_of(0, -seen(state, random))
    assert watch.frame(wrong, SURE, 0) == [0, 1, 2, 3]
    watch.age(9.0)
    assert watch.verdict is None
