"""The program on board of a formation, in vehicles without dynamics."""

from __future__ import annotations

import numpy as np
import pytest

from extensions.formations.mathematics.steering import NullMotion
from extensions.formations.options import FormationOptions
from extensions.formations.starts import APART, random_starts
from extensions.formations.tests.flock import Flock

COUNT = 5


def _options(**values: object) -> list[FormationOptions]:
    found = [FormationOptions().model_copy(deep=True) for _ in range(COUNT)]
    for one in found:
        for name, value in values.items():
            group, _, field = name.rpartition("__")
            setattr(getattr(one, group) if group else one, field, value)
    return found


def _flock(options: list[FormationOptions], seed: int = 3) -> Flock:
    random = np.random.Generator(np.random.PCG64(seed))
    shape = Flock(options, np.eye(COUNT, 3), np.zeros(COUNT)).shape
    starts = np.array(random_starts(shape.places, seed))
    heights = random.uniform(0.9, 1.5, (COUNT, 1))
    flock = Flock(options, np.hstack([starts, heights]), random.uniform(-1.0, 1.0, COUNT))
    flock.begin()
    return flock


@pytest.mark.parametrize("seed", [1, 2])
def test_it_converges_from_random_starts_and_keeps_apart(seed: int) -> None:
    flock = _flock(_options(), seed)
    assert flock.error() > 10.0
    flock.fly(9.0)
    assert flock.error() < 1.0
    assert flock.nearest > 0.8
    assert flock.events() == []
    topic, stamp_ns = flock.all[0].logged[-1]
    assert topic == "neighbour_bearings"
    assert len(flock.all[0].logged) == pytest.approx(30 * 9.2, abs=2)
    assert stamp_ns <= flock.now_ns


def test_a_commanded_null_motion_moves_turns_and_scales_and_keeps_the_bearings() -> None:
    flock = _flock(_options())
    flock.fly(9.0)
    centre, size = flock.places.mean(axis=0), np.ptp(flock.places, axis=0)
    yaws, heading = flock.yaws.copy(), flock.yaws[0]
    for pilot in flock.pilots:
        pilot.command = NullMotion((0.3, 0.0, 0.1), 0.2, 0.05)
    flock.fly(2.0)
    assert flock.error() < 1.5
    moved = flock.places.mean(axis=0) - centre
    middle = heading + 0.2  # half of the turn
    assert moved == pytest.approx([0.6 * np.cos(middle), 0.6 * np.sin(middle), 0.2], abs=0.06)
    assert flock.yaws - yaws == pytest.approx(np.full(COUNT, 0.4), abs=0.06)
    grown = np.ptp(flock.places, axis=0)[2] / size[2]
    assert grown == pytest.approx(np.exp(0.1), abs=0.04)


@pytest.mark.parametrize("loss", [0.1, 0.3, 0.6])
def test_lost_messages_leave_it_converging(loss: float) -> None:
    flock = _flock(_options(messages__loss=loss))
    flock.fly(9.0)
    assert flock.error() < 1.2
    assert flock.nearest > 0.8


def test_messages_that_are_late_leave_it_converging_and_turning() -> None:
    flock = _flock(_options(messages__delay=0.2))
    flock.fly(9.0)
    assert flock.error() < 1.2
    assert flock.nearest > 0.8
    for pilot in flock.pilots:
        pilot.command = NullMotion(yaw_rate=0.3)
    flock.fly(2.0)
    assert flock.error() < 1.2, "3.4 deg, where yaws of different times are compared"


def test_a_clock_that_is_apart_is_told_and_its_vehicle_is_left_out() -> None:
    options = _options()
    options[1].messages.clock = 12.0
    flock = _flock(options)
    flock.fly(2.0)
    for here in (flock.all[0], flock.all[2]):
        own = here.names[here.index]
        assert here.events == [
            f"formation: the stamps of quad2 are 12.0 s ahead of the clock of {own}; it is left "
            "out: set its clock"
        ]
    assert "formation: no other vehicle is in contact; it brakes" in flock.all[1].events
    assert np.abs(flock.velocities[1]).max() < 1e-9
    assert min(pilot.eigenvalue for k, pilot in enumerate(flock.pilots) if k != 1) > 0.0


def test_the_next_vehicle_leads_when_the_first_one_leaves_and_it_may_return() -> None:
    flock = _flock(_options())
    flock.fly(8.0)
    flock.land(0)
    for pilot in flock.pilots:
        pilot.command = NullMotion((0.0, 0.0, 0.1))
    flock.fly(2.0)
    height = flock.places[1:, 2].mean()
    flock.fly(1.0)
    assert flock.places[1:, 2].mean() - height == pytest.approx(0.1, abs=0.03)
    first = flock.pilots[0]
    flock.bring_back(0)
    flock.fly(1.0)
    assert first.is_flying
    for here in flock.all[1:]:
        assert here.events == ["formation: quad1 has left", "formation: quad1 is heard again"]


def test_without_any_message_it_brakes_and_tells_who_is_silent() -> None:
    flock = _flock(_options(messages__loss=1.0))
    flock.fly(3.0)
    assert float(np.abs(flock.velocities).max()) < 1e-9
    told = flock.all[0].events
    assert "formation: no other vehicle is in contact; it brakes" in told
    assert "formation: quad4 is silent; it is left out" in told


def test_a_vehicle_that_falls_silent_is_named_and_the_others_stay_rigid() -> None:
    flock = _flock(_options())
    flock.fly(10.0)
    flock.pilots[3].radio.mute = True
    flock.fly(4.0)
    assert all(
        "formation: quad4 is silent; it is left out" in here.events
        for here in flock.all
        if here.index != 3
    )
    assert flock.error(left=[3]) < 1.0
    assert min(pilot.eigenvalue for k, pilot in enumerate(flock.pilots) if k != 3) > 0.0
    before = flock.places.copy()
    for pilot in flock.pilots:
        pilot.command = NullMotion((0.5, 0.0, 0.0))
    flock.fly(3.0)
    assert flock.error(left=[3]) < 1.5, "6 deg, where each stops for itself"
    assert np.linalg.norm(flock.places[:3] - before[:3], axis=1).max() < 1.0
    slow = "formation: it slows down; "
    told = [line.removeprefix(slow) for line in flock.events() if line.startswith(slow)]
    assert "quad4 is in the way" in told
    assert all(line.endswith((" is in the way", " cannot fly as commanded")) for line in told)


@pytest.mark.parametrize(
    ("name", "value"), [("bias_z", 10.0), ("swap", 1.0)], ids=["turned", "swapped"]
)
def test_bearings_that_contradict_the_others_are_named_and_left_out(
    name: str, value: float
) -> None:
    options = _options()
    setattr(options[1].bearings, name, value)
    flock = _flock(options)
    flock.fly(12.0)
    line = "formation: the bearings of quad2 contradict those of the others; they are left out"
    assert all(here.events == [line] for here in flock.all)
    assert flock.error() < 0.6
    assert flock.nearest > 0.8


def test_edges_that_leave_it_not_rigid_are_named_and_it_brakes() -> None:
    options = _options()
    for one in options[1:]:
        one.bearings.lost = "all"
    flock = _flock(options)
    flock.fly(2.0)
    assert float(np.abs(flock.velocities).max()) < 1e-9
    told = flock.all[0].events[0]
    assert told.startswith("formation: not rigid, it brakes; it lacks quad")


def test_random_starts_are_apart_and_depend_on_the_seed() -> None:
    shape = Flock(_options(), np.eye(COUNT, 3), np.zeros(COUNT)).shape
    first, again, other = (np.array(random_starts(shape.places, seed)) for seed in (7, 7, 8))
    assert (first == again).all()
    assert (first != other).any()
    i, j = np.triu_indices(COUNT, 1)
    assert np.linalg.norm(first[i] - first[j], axis=1).min() >= APART - 2e-3
