"""The separation of the vehicles in flight, in kinematics."""

from __future__ import annotations

import numpy as np
import pytest

from extensions.formations.messages import Message, Whereabouts
from extensions.formations.options import FormationOptions
from extensions.formations.separation import KEPT, SEPARATION
from extensions.formations.starts import random_starts
from extensions.formations.tests.flock import LIMITS, Flock
from quadrotor.records import Array

DT = 0.05


def _flock(places: Array) -> Flock:
    options = [FormationOptions().model_copy(deep=True) for _ in places]
    return Flock(options, places, np.zeros(len(places)))


def _scattered(random: np.random.Generator, count: int) -> Array:
    """Return places in a room of 4 x 4 x 1.5 m, no two nearer than is kept."""
    i, j = np.triu_indices(count, 1)
    while True:
        places = random.uniform(-2.0, 2.0, (count, 3)) * (1.0, 1.0, 0.4)
        if np.linalg.norm(places[i] - places[j], axis=1).min() > KEPT:
            return np.asarray(places)


def _step(flock: Flock, asked: Array, lag: float) -> None:
    """Fly on by DT, each vehicle by what the others broadcast DT before."""
    flock.now_ns += round(1e9 * DT)
    sent = {k: pilot.radio.own for k, pilot in enumerate(flock.pilots)}
    for k, (guard, pilot) in enumerate(zip(flock.guards, flock.pilots, strict=True)):
        pilot.radio.places = {j: one for j, one in sent.items() if one is not None and j != k}
        flown = guard.keep(asked[k], flock.places[k], flock.now_ns, LIMITS)
        flock.velocities[k] += DT / max(DT, lag) * (flown - flock.velocities[k])
    flock.places += DT * flock.velocities


def test_a_vehicle_that_has_left_is_known_by_its_place_alone() -> None:
    flock = _flock(np.array([[-1.5, 0.0, 1.0], [1.5, 0.0, 1.0]]))
    here, other = (pilot.radio for pilot in flock.pilots)
    other.has_left = True
    other.own = Whereabouts(0, (1.5, 0.0, 0.25), (0.0, 0.0, -0.5))
    other.send(Message(0, 0.1, 1.5, {0: (-1.0, 0.0, 0.0)}))
    flock.meet()
    heard = [*here.arrived(0), *here.arrived(1_000_000_000)]  # a message takes its time
    assert heard == [], "its bearings and yaw lead nobody"
    assert here.places[1] == other.own
    assert here.left == {1}


@pytest.mark.parametrize("lag", [0.0, 0.25])
@pytest.mark.parametrize("seed", range(6))
def test_no_two_come_nearer_than_the_separation_on_any_paths(seed: int, lag: float) -> None:
    random = np.random.Generator(np.random.PCG64(seed))
    count = 2 + seed % 4
    flock = _flock(_scattered(random, count))
    goals = flock.places[random.permutation(count)] if seed % 2 else -flock.places
    i, j = np.triu_indices(count, 1)
    for _ in range(160):
        _step(flock, 1.5 * (goals - flock.places), lag)
        apart = np.linalg.norm(flock.places[i] - flock.places[j], axis=1)
        assert apart.min() >= SEPARATION


def test_two_that_meet_head_on_pass_each_other() -> None:
    flock = _flock(np.array([[-1.5, 0.0, 1.0], [1.5, 0.0, 1.0]]))
    goals = flock.places[::-1].copy()
    for _ in range(240):
        _step(flock, 1.5 * (goals - flock.places), 0.0)
    assert flock.places == pytest.approx(goals, abs=0.05)
    assert flock.events() == []


@pytest.mark.parametrize("lag", [0.0, 0.25])
def test_two_that_fly_one_behind_the_other_are_not_slowed_and_the_first_may_stop(
    lag: float,
) -> None:
    flock = _flock(np.array([[0.0, 0.0, 1.0], [1.3, 0.0, 1.0]]))
    together = np.array([[0.6, 0.0, 0.0], [0.6, 0.0, 0.0]])
    for _ in range(100):
        _step(flock, together, lag)
    assert flock.velocities == pytest.approx(together, abs=0.02)
    for _ in range(100):
        _step(flock, together * [[1.0], [0.0]], lag)
        assert np.linalg.norm(flock.places[1] - flock.places[0]) >= SEPARATION


def test_what_is_asked_for_is_flown_while_nobody_is_near() -> None:
    flock = _flock(np.array([[-2.0, 0.0, 1.0], [2.0, 0.0, 1.0]]))
    asked = np.array([[-0.5, 0.2, 0.1], [0.3, -0.2, 0.0]])
    _step(flock, asked, 0.0)
    _step(flock, asked, 0.0)
    assert flock.velocities == pytest.approx(asked, abs=1e-6)


def test_a_vehicle_that_is_held_up_tells_by_whom() -> None:
    flock = _flock(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0 + KEPT]]))
    down_and_up = np.array([[0.0, 0.0, 0.4], [0.0, 0.0, 0.0]])
    for _ in range(80):
        _step(flock, down_and_up, 0.0)
    line = "formation: quad2 in the way; to keep 0.8 m apart, this vehicle stops"
    assert flock.all[0].events == [line]
    assert flock.all[1].events == []


def test_a_vehicle_neither_heard_nor_seen_stops_the_others_and_is_named() -> None:
    flock = _flock(np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 1.0]]))
    guard, radio = flock.guards[0], flock.pilots[0].radio
    asked, here = (0.3, 0.0, 0.0), flock.places[0]
    for now_ns in range(0, 1_000_000_000, 50_000_000):
        assert guard.keep(asked, here, now_ns, LIMITS) == pytest.approx(np.zeros(3))
    line = "formation: quad2 is neither heard nor seen; to keep apart from it, this vehicle stops"
    assert flock.all[0].events == [line]
    radio.places[1] = Whereabouts(1_000_000_000, (2.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    assert guard.keep(asked, here, 1_000_000_000, LIMITS) == pytest.approx(asked)
    assert flock.all[0].events == [line, "formation: quad2 is in contact again"]


def test_a_silent_vehicle_in_sight_is_not_approached() -> None:
    flock = _flock(np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 1.0]]))
    guard, radio = flock.guards[0], flock.pilots[0].radio
    radio.sent = Message(0, 0.0, 0.0, {1: (1.0, 0.0, 0.0)})
    assert guard.keep((0.3, 0.1, 0.0), flock.places[0], 0, LIMITS)[0] <= 1e-6
    assert guard.keep((-0.3, 0.1, 0.0), flock.places[0], 0, LIMITS) == pytest.approx(
        [-0.3, 0.1, 0.0]
    )


def test_the_flock_converges_from_crossing_starts_and_keeps_apart() -> None:
    count, random = 5, np.random.Generator(np.random.PCG64(2))
    shape = _flock(np.eye(count, 3)).shape
    starts = np.array(random_starts(shape.places, 2, crossing=True))
    places = np.hstack([starts, random.uniform(0.9, 1.5, (count, 1))])
    options = [FormationOptions().model_copy(deep=True) for _ in range(count)]
    flock = Flock(options, places, random.uniform(-1.0, 1.0, count), lag=0.25)
    flock.begin()
    assert flock.error() > 60.0
    flock.fly(14.0)
    assert flock.error() < 2.0
    assert flock.nearest >= SEPARATION
