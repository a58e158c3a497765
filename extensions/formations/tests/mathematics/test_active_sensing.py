"""The Gramian against a plain sum, and paths that keep to their limits and tell more."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.estimation.sensing_flights import Case, Path, fly
from control.trajectories.tabulated import tabulate
from extensions.formations.mathematics.active_sensing import (
    TIMES,
    LookAround,
    Room,
    Sights,
    basis,
    carried,
    gramian,
    smallest,
)
from extensions.formations.mathematics.look_around import LookAroundPath
from extensions.formations.mathematics.rigidity import across
from quadrotor.errors import DegenerateGeometryError
from quadrotor.records import REFERENCE, Array

BEACONS = np.array([[1.0, 1.0, 0.1], [1.0, -1.0, 0.1], [-1.0, 1.0, 0.1]])
S_Z = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
START = np.diag([0.3, 0.3, 0.3, 0.17]) ** 2


def by_sum(path: Array, sights: Sights, yaw: float) -> Array:
    """Return the Gramian as a sum over samples, each carried to the end by the motion's matrix."""
    G = np.zeros((4, 4))
    c, s = math.cos(yaw), math.sin(yaw)
    back = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    dt = float(TIMES[1])
    for t, p in zip(TIMES, path, strict=True):
        to_here = np.eye(4)
        to_here[:3, 3] = -S_Z @ (path[-1] - p)
        for b in sights.landmarks_w:
            d = float(np.linalg.norm(b - p))
            g = (b - p) / d
            own = np.column_stack([-back @ across(g) / d, -S_Z @ back @ g])
            rows = [own]
            if sights.mutual:
                rows.append(np.column_stack([across(g) / d, np.zeros(3)]))
            for row in rows:
                H = row @ to_here
                fade = math.exp((t - TIMES[-1]) / sights.memory)
                G += fade * sights.rate * dt * H.T @ H / sights.sigma**2
    return G


@pytest.mark.parametrize("mutual", [False, True])
def test_the_gramian_is_the_information_of_the_path_at_its_end(mutual: bool) -> None:
    rng = np.random.default_rng(1)
    path = basis(TIMES) @ (np.array([0.0, 0.0, 1.2]) + 0.3 * rng.normal(size=(11, 3)))
    sights = Sights(BEACONS[:2], mutual=mutual, memory=3.0)
    np.testing.assert_allclose(
        gramian(path, TIMES, sights), by_sum(path, sights, 0.7), rtol=1e-9, atol=1e-6
    )
    batch = gramian(np.stack([path, path + 0.1]), TIMES, sights)
    np.testing.assert_allclose(batch[0], gramian(path, TIMES, sights))


def test_information_is_carried_by_the_motion() -> None:
    P, travel = np.diag([0.1, 0.2, 0.3, 0.4]), np.array([1.0, -2.0, 0.5])
    F = np.eye(4)
    F[:3, 3] = S_Z @ travel
    found = carried(np.linalg.inv(P), travel, 0.0, Sights(BEACONS))
    np.testing.assert_allclose(np.linalg.inv(found), F @ P @ F.T)


def test_the_mean_of_the_eigenvalues_stays_below_the_smallest_and_near_it() -> None:
    rng = np.random.default_rng(2)
    A = rng.normal(size=(50, 4, 4))
    A = A @ np.swapaxes(A, 1, 2)
    least = np.linalg.eigvalsh(A)[:, 0]
    assert (smallest(A) <= least).all()
    assert (smallest(A) >= least * 4.0**-0.25).all()


def test_the_spline_has_the_derivatives_that_it_says() -> None:
    plan = LookAround(Room((0.0, 0.0, 1.0)), Sights(BEACONS))
    plan.plan(START)
    t, h = np.linspace(0.13, 3.83, 17), 1e-5
    _, v, a = plan.at(t)
    ahead, behind = plan.at(t + h), plan.at(t - h)
    np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * h), v, atol=1e-6)
    np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * h), a, atol=1e-5)
    end = plan.at([4.0, 9.0])
    np.testing.assert_allclose(end[1], 0.0, atol=1e-12)


def test_plans_keep_to_their_limits_join_smoothly_and_tell_more_than_staying() -> None:
    rng = np.random.default_rng(3)
    sights = Sights(BEACONS, memory=3.0)
    for _ in range(5):
        centre = np.array([*rng.uniform(-1.2, 1.2, 2), rng.uniform(0.4, 1.9)])
        room = Room(tuple(centre.tolist()), radius=0.8, speed=0.7, acceleration=1.5)
        plan = LookAround(room, sights)
        gained = []
        for _ in range(8):
            plan.plan(START)
            plan.advance()
            p, v, a = plan.at(np.linspace(0.0, 4.0, 81))
            assert (np.linalg.norm(p - centre, axis=1) <= 0.8 + 1e-9).all()
            assert ((p[:, 2] >= 0.3 - 1e-9) & (p[:, 2] <= 2.0 + 1e-9)).all()
            assert (np.linalg.norm(v, axis=1) <= 0.7 + 1e-9).all()
            assert (np.linalg.norm(a, axis=1) <= 1.5 + 1e-9).all()
            again = LookAround(room, sights)
            again.points_w = plan.points_w.copy()
            again.plan(START)
            for old, new in zip(plan.at([0.0]), again.at([0.0]), strict=True):
                np.testing.assert_allclose(old, new, atol=1e-9)  # a new plan joins the flown path
            gained.append(float(smallest(gramian(p[:41:2], TIMES[:21], sights))))
        stay = np.tile(centre, (21, 1))
        assert gained[-1] > 1.2 * float(smallest(gramian(stay, TIMES[:21], sights)))


def test_looking_around_beats_the_straight_path_and_the_filter_is_consistent() -> None:
    rng = np.random.default_rng(4)
    starts = np.column_stack([rng.uniform(-1.2, 1.2, (12, 2)), rng.uniform(0.5, 1.8, 12)])
    case = Case(BEACONS, mutual=False, motion_noise=0.01)
    around, straight = (
        fly(path, case, starts, 4.0, 1) for path in (Path.LOOK_AROUND, Path.STRAIGHT)
    )
    assert around.sigma[:, -1].mean() < 0.9 * straight.sigma[:, -1].mean()
    for outcome in (around, straight):
        assert 2.0 < outcome.square.mean() < 7.0  # 4 on average, 12 flights
        np.testing.assert_allclose(outcome.sigma[:, -1], outcome.bound[:, -1], rtol=0.15)


def test_a_path_is_a_trajectory_that_a_vehicle_accepts() -> None:
    room = Room((0.5, 0.2, 1.0), radius=0.8)
    path = LookAroundPath(room, Sights(BEACONS, memory=0.7), 8.0, yaw=0.4)
    assert tabulate("look_around", path).duration == path.duration == 8.0  # consistent, at rest
    reference = np.zeros(1, REFERENCE)
    places = []
    for t in np.linspace(-1.0, 9.0, 201):
        path.sample(float(t), reference)
        places.append(reference["position_w"][0].copy())
        assert np.linalg.norm(reference["velocity_w"]) <= room.speed
        assert np.linalg.norm(reference["acceleration_w"]) <= room.acceleration
    away = np.linalg.norm(np.array(places) - room.centre_w, axis=1)
    assert away[0] < 1e-12
    assert 0.4 < away.max() <= 0.8
    assert reference["yaw"] == 0.4


def test_what_cannot_be_planned_is_told() -> None:
    with pytest.raises(DegenerateGeometryError, match="at least two"):
        Sights(BEACONS[:1])
    with pytest.raises(DegenerateGeometryError, match=r"height 3\.0 m is not within"):
        Room((0.0, 0.0, 3.0))
    with pytest.raises(DegenerateGeometryError, match="duration is 1 s; allowed 5 to 600 s"):
        LookAroundPath(Room((0.0, 0.0, 1.0)), Sights(BEACONS), 1.0)
    with pytest.raises(DegenerateGeometryError, match="must be positive"):
        Room((0.0, 0.0, 1.0), speed=0.0)
