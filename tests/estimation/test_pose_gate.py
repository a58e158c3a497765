"""The complementary filter's gate: outliers, swaps, jumps, drift, and the recovery."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from estimation.outcome import Agreement
from estimation.parameters import EstimationParameters
from estimation.pose_gate import DRIFT_WAIT, JUMP_WAIT, rotation_vector
from quadrotor.records import Array

OFF = np.array([1.0, 0.0, 0.0])
PARAMETERS = EstimationParameters()
WHEN = 10.0
"""s; the filter has settled and the vehicle is at full speed."""


def within(t: Array, start: float, duration: float) -> npt.NDArray[np.bool_]:
    inside: npt.NDArray[np.bool_] = (t >= start - 1e-6) & (t < start + duration - 1e-6)
    return inside


def worst(flown: Any, name: str, start: float, end: float = math.inf) -> float:
    rows = (flown.t >= start) & (flown.t < end)
    return float(np.linalg.norm(getattr(flown, name)[rows], axis=1).max())


def agreements(flown: Any) -> list[int]:
    """Return each agreement once, in the order of arrival."""
    seen = flown.estimates["agreement"].tolist()
    return [k for k, before in zip(seen, [None, *seen[:-1]], strict=True) if k != before]


def refused(flown: Any) -> int:
    return int(flown.estimates["measurements_refused"][-1])


@pytest.fixture(scope="module")
def eight(laboratory: Any) -> Any:
    """Return the figure 8 in 4 s: 2 m/s and 3 m/s^2."""
    return laboratory.figure_eight(16.0, 500.0, period=4.0)


@pytest.mark.parametrize("seed", range(3))
def test_clean_poses_of_a_fast_flight_are_never_refused(
    laboratory: Any, eight: Any, seed: int
) -> None:
    flown = laboratory.fly(eight, laboratory.full, seed=seed)
    assert refused(flown) == 0
    assert agreements(flown) == [Agreement.USED]
    every = laboratory.fly(eight, laboratory.full, EstimationParameters(pose_gate=1000.0), seed)
    np.testing.assert_array_equal(flown.states, every.states)


@pytest.mark.parametrize("off", [1.0, 0.3])
def test_one_pose_far_off_does_nothing(laboratory: Any, eight: Any, off: float) -> None:
    """Without the gate, 1 m gave 0.16 m and 0.64 m/s."""

    def spoil(t: Array, position: Array, *_: Array) -> None:
        position[within(t, WHEN, 0.01)] += off * OFF

    flown = laboratory.fly(eight, laboratory.full, spoil=spoil)
    clean = laboratory.fly(eight, laboratory.full)
    assert refused(flown) == 1
    assert agreements(flown) == [Agreement.USED, Agreement.REFUSED, Agreement.USED]
    assert np.abs(flown.position - clean.position).max() < 1e-3
    assert np.abs(flown.velocity - clean.velocity).max() < 5e-3
    rows = flown.estimates["agreement"] == Agreement.REFUSED
    assert rows.sum() == 5  # until the next pose
    assert not flown.converged[rows].any()


@pytest.mark.parametrize("turn", [20.0, 90.0, 180.0])
def test_one_attitude_far_off_does_nothing(laboratory: Any, eight: Any, turn: float) -> None:
    """The sine, which is the filter's innovation, is zero for half a turn."""

    def spoil(t: Array, _: Array, attitude: Array, *__: Array) -> None:
        row = within(t, WHEN, 0.01)
        yawed = Rotation.from_euler("z", turn, degrees=True)
        seen = Rotation.from_quat(np.roll(attitude[row], -1, axis=1)) * yawed
        attitude[row] = np.roll(seen.as_quat(), 1, axis=1)

    flown = laboratory.fly(eight, laboratory.full, spoil=spoil)
    clean = laboratory.fly(eight, laboratory.full)
    assert refused(flown) == 1
    assert np.abs(flown.attitude - clean.attitude).max() < math.radians(0.05)


@pytest.mark.parametrize("every", [2, 5, 17])
def test_two_bodies_swapped_for_a_fifth_of_a_second_do_nothing(
    laboratory: Any, eight: Any, every: int
) -> None:
    """250, 100 and 30 poses a second.

    Without the gate it was off by 1.15 m and 3.2 m/s, and reported to be converged.
    """

    def spoil(t: Array, position: Array, *_: Array) -> None:
        position[within(t, WHEN, 0.2)] = (1.5, 0.2, 0.8)

    sensors = dataclasses.replace(laboratory.full, pose_every=every)
    flown = laboratory.fly(eight, sensors, spoil=spoil)
    clean = laboratory.fly(eight, sensors)
    assert refused(flown) == pytest.approx(100 / every, abs=1.0)
    assert np.abs(flown.position - clean.position).max() < 0.01
    assert np.abs(flown.velocity - clean.velocity).max() < 0.06
    assert agreements(flown)[:3] == [Agreement.USED, Agreement.REFUSED, Agreement.JUMPED]
    assert agreements(flown)[-1] == Agreement.USED
    assert not flown.converged[flown.estimates["agreement"] == Agreement.JUMPED].any()
    assert flown.converged[-1]


@pytest.mark.parametrize("every", [1, 5, 17, 50])
@pytest.mark.parametrize("size", [0.3, 1.0])
def test_a_tracker_that_moved_for_good_is_told_from_drift_and_followed(
    laboratory: Any, eight: Any, every: int, size: float
) -> None:
    """500 to 10 poses a second: the estimate stays, then moves at once, without a kick."""
    off = size * OFF

    def spoil(t: Array, position: Array, *_: Array) -> None:
        position[t >= WHEN - 1e-6] += off

    sensors = dataclasses.replace(laboratory.full, pose_every=every)
    flown = laboratory.fly(eight, sensors, spoil=spoil)
    moved = float(flown.t[flown.estimates["agreement"] == Agreement.MOVED][0])
    assert JUMP_WAIT <= moved - WHEN <= JUMP_WAIT + 1.5 * every / 500.0
    assert agreements(flown) == [
        Agreement.USED,
        Agreement.REFUSED,
        Agreement.JUMPED,
        Agreement.MOVED,
        Agreement.USED,
    ]
    assert worst(flown, "position", WHEN, moved) < 0.03
    after = flown.t > moved + 0.01
    assert np.linalg.norm(flown.position[after] - off, axis=1).max() < 0.03
    assert worst(flown, "velocity", WHEN) < 0.12
    assert not flown.converged[within(flown.t, WHEN + 3 * every / 500.0, 1.0)].any()
    assert flown.converged[-1]


def test_a_tracker_whose_world_turned_is_followed(laboratory: Any, eight: Any) -> None:
    turn = Rotation.from_euler("z", 60.0, degrees=True)

    def spoil(t: Array, position: Array, attitude: Array, _: Array) -> None:
        rows = t >= WHEN - 1e-6
        position[rows] = turn.apply(position[rows])
        seen = turn * Rotation.from_quat(np.roll(attitude[rows], -1, axis=1))
        attitude[rows] = np.roll(seen.as_quat(), 1, axis=1)

    flown = laboratory.fly(eight, laboratory.full, spoil=spoil)
    assert Agreement.MOVED in agreements(flown)
    last = flown.t > 14.0
    truth = eight.position_w[last], eight.velocity_w[last]
    states = flown.states[last]
    assert np.abs(states["position_w"] - turn.apply(truth[0])).max() < 0.01
    assert np.abs(states["velocity_w"] - turn.apply(truth[1])).max() < 0.05


def test_an_estimate_that_drifts_is_told_from_a_jump_and_gets_its_poses(
    laboratory: Any, eight: Any
) -> None:
    """The accelerometer is off by 60 m/s^2 for a sixth of a second, as after a hard impact."""

    def spoil(t: Array, _: Array, __: Array, force: Array) -> None:
        force[within(t, WHEN, 0.16)] += (60.0, 0.0, 0.0)

    flown = laboratory.fly(eight, laboratory.full, spoil=spoil)
    every = laboratory.fly(
        eight, laboratory.full, EstimationParameters(pose_gate=1000.0), spoil=spoil
    )
    assert agreements(flown) == [Agreement.USED, Agreement.DRIFTED, Agreement.USED]
    assert refused(flown) == 0
    np.testing.assert_array_equal(flown.states, every.states)
    drifts = flown.estimates["agreement"] == Agreement.DRIFTED
    assert drifts[within(flown.t, WHEN + 0.1, 0.06)].all()
    assert not flown.converged[drifts].any()


def test_a_slow_drift_of_the_imu_is_followed_without_a_refusal(laboratory: Any, eight: Any) -> None:
    def spoil(t: Array, _: Array, __: Array, force: Array) -> None:
        force += np.outer(np.maximum(t - 5.0, 0.0), (0.3, 0.0, 0.0))

    flown = laboratory.fly(eight, laboratory.full, spoil=spoil)
    assert refused(flown) == 0
    assert worst(flown, "position", 5.0) < 0.1


@pytest.mark.parametrize("seed", range(3))
def test_a_fifth_of_the_poses_being_anywhere_does_little(
    laboratory: Any, eight: Any, seed: int
) -> None:
    rng = np.random.default_rng(seed)

    def spoil(t: Array, position: Array, *_: Array) -> None:
        rows = rng.uniform(size=len(t)) < 0.2
        position[rows] = rng.uniform((-2.0, -2.0, 0.0), (2.0, 2.0, 2.5), (rows.sum(), 3))

    flown = laboratory.fly(eight, laboratory.full, seed=seed, spoil=spoil)
    share = refused(flown) / (refused(flown) + flown.estimates["measurements_used"][-1])
    assert 0.14 < share < 0.26
    assert worst(flown, "position", 4.0) < 0.03
    assert worst(flown, "velocity", 4.0) < 0.2
    settled = set(flown.estimates["agreement"][flown.t > 4.0].tolist())
    assert settled == {Agreement.USED, Agreement.REFUSED}


@pytest.mark.parametrize("gap", [0.3, 2.0])
def test_the_first_pose_after_a_gap_gets_in(laboratory: Any, eight: Any, gap: float) -> None:
    def spoil(t: Array, position: Array, *_: Array) -> None:
        position[within(t, WHEN, gap)] = np.nan

    flown = laboratory.fly(eight, laboratory.full, spoil=spoil)
    assert refused(flown) == 0
    assert worst(flown, "position", WHEN + gap + 0.5) < 0.05


def test_poses_after_a_gap_that_the_prediction_did_not_survive_are_soon_followed(
    laboratory: Any, eight: Any
) -> None:
    """After 2 s with the accelerometer off by 3 m/s^2, it is 6 m and 6 m/s away."""

    def spoil(t: Array, position: Array, _: Array, force: Array) -> None:
        gap = within(t, WHEN, 2.0)
        position[gap] = np.nan
        force[gap] += (3.0, 0.0, 0.0)

    flown = laboratory.fly(eight, laboratory.full, spoil=spoil)
    assert agreements(flown) == [
        Agreement.USED,
        Agreement.REFUSED,
        Agreement.DRIFTED,
        Agreement.MOVED,
        Agreement.USED,
    ]
    assert worst(flown, "position", WHEN + 2.0, WHEN + 2.1) > 5.0
    back = WHEN + 2.0 + DRIFT_WAIT + 0.02
    assert worst(flown, "position", back) < 0.05
    assert worst(flown, "velocity", back) < 0.5
    assert worst(flown, "velocity", back + 1.0) < 0.1


@pytest.mark.parametrize(("far", "yaw"), [(0.5, 0.0), (1.0, 20.0), (5.0, 0.0), (0.0, 180.0)])
def test_a_wrong_first_pose_is_forgotten(laboratory: Any, far: float, yaw: float) -> None:
    """Half a turn, too, which the filter's innovation does not see."""

    def spoil(_: Array, position: Array, attitude: Array, __: Array) -> None:
        position[0] += far * OFF
        seen = Rotation.from_quat(np.roll(attitude[0], -1)) * Rotation.from_euler(
            "z", yaw, degrees=True
        )
        attitude[0] = np.roll(seen.as_quat(), 1)

    flown = laboratory.fly(laboratory.figure_eight(4.0, 500.0, 0.0), laboratory.full, spoil=spoil)
    assert worst(flown, "position", 2.5) < 0.03
    assert worst(flown, "attitude", 3.5) < math.radians(1.0)
    assert flown.converged[-1]
    assert not flown.converged[:500].any()


def test_more_noise_than_stated_opens_the_gate(laboratory: Any, eight: Any) -> None:
    """0.1 m on each axis, ten times the parameters' noise."""
    rng = np.random.default_rng(1)

    def spoil(t: Array, position: Array, *_: Array) -> None:
        rows = t >= WHEN
        position[rows] += rng.normal(0.0, 0.1, (rows.sum(), 3))

    flown = laboratory.fly(eight, laboratory.full, spoil=spoil)
    counts = flown.estimates["measurements_refused"]
    assert 0 < counts[-1] < 40
    assert counts[-1] - counts[flown.t >= WHEN + 1.0][0] <= 1


def test_an_attitude_of_a_run_moves_the_estimate_by_its_whole_angle() -> None:
    rng = np.random.default_rng(3)
    for length in (0.0, 1e-13, 1e-6, 0.1, 2.0, 3.14):
        axis = rng.normal(size=3)
        wanted = length * axis / np.linalg.norm(axis)
        for sign in (1.0, -1.0):
            q = sign * np.roll(Rotation.from_rotvec(wanted).as_quat(), 1)
            found = rotation_vector(tuple(q.tolist()))
            np.testing.assert_allclose(found, wanted, atol=1e-12)
