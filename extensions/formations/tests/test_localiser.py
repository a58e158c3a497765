"""The places of the others by bearings: the filter on board, and what is judged of it."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from extensions.formations.localiser import NOISE, TOPIC, Localiser
from extensions.formations.mathematics.localisation import NetworkFilter
from extensions.formations.mathematics.rigidity import bearings, yaw_rotation
from extensions.formations.messages import DISTANCE_SIGMA, Message, Whereabouts
from extensions.formations.options import FormationOptions
from extensions.formations.places import judge_places
from extensions.formations.starts import random_starts
from extensions.formations.tests.flock import Flock
from flight_log.run import Run
from quadrotor.records import Array

SIGMA = math.radians(1.5)
PLACES = np.array([[0.0, 0.0, 1.0], [1.6, 0.2, 1.3], [0.3, 1.5, 0.8], [-1.2, 0.4, 1.1]])
YAWS = np.array([0.2, -0.4, 0.9, 0.0])
EDGES = [(i, j) for i in range(4) for j in range(4) if i != j]
PERIOD_NS = 33_333_333
EVERY = frozenset(range(4))


def _still(count: int = 4) -> tuple[Flock, Localiser]:
    options = [FormationOptions().model_copy(deep=True) for _ in range(count)]
    flock = Flock(options, PLACES[:count], YAWS[:count])
    here, radio = flock.all[0], flock.pilots[0].radio
    radio.own = Whereabouts(0, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    radio.places = dict.fromkeys(range(1, count), radio.own)
    return flock, Localiser(here, radio, SIGMA)


def _frames(count: int) -> list[dict[int, Message]]:
    """Return messages of vehicles at rest, by frame and vehicle."""
    random, found = np.random.Generator(np.random.PCG64(5)), []
    for frame in range(1, count + 1):
        noisy = bearings(PLACES, YAWS, EDGES) + random.normal(0.0, SIGMA, (len(EDGES), 3))
        noisy /= np.linalg.norm(noisy, axis=1, keepdims=True)
        seen = dict(zip(EDGES, noisy.tolist(), strict=True))
        found.append(
            {
                k: Message(
                    frame * PERIOD_NS,
                    float(YAWS[k]),
                    1.6 if k == 0 else 0.0,
                    {j: seen[k, j] for j in range(4) if j != k},
                )
                for k in range(4)
            }
        )
    return found


@pytest.mark.parametrize("late", [0, 2], ids=["at once", "two frames late"])
def test_it_is_the_filter_of_the_network_also_with_messages_that_are_late(late: int) -> None:
    _, localiser = _still()
    frames, expected = _frames(12), None
    waiting: list[tuple[int, Message]] = []
    for number, frame in enumerate(frames, start=1):
        waiting.append((number + late, frame[3]))
        for k in range(3):
            localiser.note(k, frame[k])
        for due, message in list(waiting):
            if due <= number:
                waiting.remove((due, message))
                localiser.note(3, message)
        localiser.step(EVERY, number * PERIOD_NS)
    still = dict.fromkeys(range(4), (np.zeros(3), 0.0))
    for frame in frames[: len(frames) - late]:
        seen = {(i, j): one for i in range(4) for j, one in frame[i].bearings_y.items()}
        if expected is None:
            expected = NetworkFilter.from_bearings(
                0, 4, np.array(list(seen.values())), list(seen), SIGMA, noise=NOISE
            )
        else:
            expected.predict(still, 1e-9 * PERIOD_NS)
            expected.bearings(list(seen), np.array(list(seen.values())), SIGMA)
        expected.distance(0, 1, 1.6, DISTANCE_SIGMA)
    assert localiser.filter is not None
    assert expected is not None
    for own, others in zip(localiser.filter.estimate, expected.estimate, strict=True):
        assert own == pytest.approx(others, abs=1e-9)


def test_it_does_not_wait_for_a_message_that_is_lost() -> None:
    flock, localiser = _still()
    first, *frames = _frames(20)
    for k, message in first.items():
        localiser.note(k, message)
    for number, frame in enumerate(frames, start=2):
        for k in range(3):
            localiser.note(k, frame[k])
        localiser.step(EVERY, number * PERIOD_NS)
    assert localiser.filter is not None
    assert {topic for topic, _ in flock.all[0].logged} == {f"{TOPIC}quad{k}" for k in (2, 3, 4)}
    newest_ns = flock.all[0].logged[-1][1]
    assert 20 * PERIOD_NS - newest_ns == pytest.approx(0.5e9, abs=4 * PERIOD_NS)


def test_it_goes_on_with_those_that_stay_down_to_two() -> None:
    _, localiser = _still()
    frames = _frames(9)
    for number, frame in enumerate(frames, start=1):
        members = range(4 if number < 4 else 3 if number < 7 else 2)
        for k in members:
            localiser.note(k, frame[k])
        localiser.step(frozenset(members), number * PERIOD_NS)
        assert localiser.members == [*members]
        assert localiser.filter is not None
        assert len(localiser.filter.yaws) == len(members)


def test_a_vehicle_whose_own_bearings_are_not_trusted_estimates_nothing() -> None:
    _, localiser = _still()
    for number, frame in enumerate(_frames(5), start=1):
        for k, message in frame.items():
            localiser.note(k, message)
        localiser.step(EVERY - {0}, number * PERIOD_NS)
    assert localiser.filter is None


def test_vehicles_that_fly_know_each_other_as_well_as_the_bound_allows() -> None:
    count, random = 4, np.random.Generator(np.random.PCG64(2))
    options = [FormationOptions().model_copy(deep=True) for _ in range(count)]
    shape = Flock(options, np.eye(count, 3), np.zeros(count)).shape
    starts = np.column_stack([random_starts(shape.places, 2), random.uniform(0.9, 1.5, count)])
    yaws = random.uniform(-1.0, 1.0, count)
    flock = Flock(options, starts, yaws, lag=0.25, localise=[0])
    flock.begin()
    flock.fly(1.0)
    localiser = flock.pilots[0].localiser
    assert localiser is not None
    squares, stated = 0.0, 0.0
    for _ in range(40):
        flock.fly(0.1)
        assert localiser.filter is not None
        places, _, covariance = localiser.filter.estimate
        true = (flock.places - flock.places[0]) @ yaw_rotation(flock.yaws[0])
        squares += float(((places - true) ** 2).sum())
        stated += float(np.diag(covariance).reshape(count - 1, 4)[:, :3].sum())
    assert math.sqrt(squares / stated) < 1.1


class _Columns:
    """A topic of a log, as the verdict reads it."""

    def __init__(self, time: Array, rows: Array) -> None:
        self.time, self._rows = time, rows

    def table(self, names: object, start: float, end: float) -> Array:
        return self._rows[(self.time >= start) & (self.time <= end)]


def test_the_error_is_judged_in_the_yaw_frame_of_the_one_that_estimates() -> None:
    times = np.arange(20.0, 22.0, 0.05)
    truth = np.repeat(PLACES[None], len(times), axis=0), np.repeat(YAWS[None], len(times), axis=0)
    shape = Flock([FormationOptions()] * 4, PLACES, YAWS).shape
    runs = {}
    for own in range(4):
        seen = (PLACES - PLACES[own]) @ yaw_rotation(YAWS[own]) + [0.03, 0.0, 0.04]
        topics = {
            f"{TOPIC}quad{k + 1}": _Columns(times, np.repeat(seen[k][None], len(times), axis=0))
            for k in range(4)
            if k != own
        }
        runs[f"quad{own + 1}"] = cast(Run, SimpleNamespace(topics=topics))
    figures = judge_places(FormationOptions(), shape, runs, times, truth, left=set())
    assert figures["places_rms_cm"] == pytest.approx(5.0)
    assert 0.5 < figures["places_over_bound"] < 5.0
    none = {name: cast(Run, SimpleNamespace(topics={})) for name in runs}
    assert judge_places(FormationOptions(), shape, none, times, truth, left=set()) == {}
