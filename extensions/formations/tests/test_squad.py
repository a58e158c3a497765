"""The programs of a formation in real time, in vehicles without dynamics."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection

import numpy as np
import pytest

from extensions.formations.live.squad import Pose, Situation, Squad
from extensions.formations.mathematics.steering import NullMotion
from extensions.formations.options import FormationOptions
from extensions.formations.pilot import STEP
from quadrotor.errors import UsageError

NAMES = ("quad1", "quad2", "quad3", "quad4")
LIMITS = (1.0, 1.0, 0.5)


class Sky:
    """Vehicles that fly at once what their sticks command."""

    def __init__(self) -> None:
        self.told: list[str] = []
        self.squad = Squad(NAMES, FormationOptions(), lambda _, line: self.told.append(line))
        self.places = 2.0 * self.squad.shape.places + [0.0, 0.0, 1.5]
        self.places[0] += 0.2  # off its place
        self.yaws, self.velocities = np.zeros(len(NAMES)), np.zeros((len(NAMES), 3))
        self.now_ns = 1_000_000_000

    def fly(
        self,
        seconds: float,
        command: NullMotion | None = None,
        change: Callable[[int, Situation], Situation] = lambda k, one: one,
    ) -> list[Collection[int]]:
        """Fly on; return who was sent sticks in each step."""
        sent: list[Collection[int]] = []
        for _ in range(round(seconds / STEP)):
            self.now_ns += round(1e9 * STEP)
            known = [change(k, self._situation(k)) for k in range(len(NAMES))]
            sticks = self.squad.step(self.now_ns, known, command or NullMotion())
            sent.append(sticks.keys())
            self.velocities[:] = 0.0
            for k, (*axes, turn) in sticks.items():
                c, s = math.cos(self.yaws[k]), math.sin(self.yaws[k])
                x, y, z = np.array(axes) * LIMITS
                self.velocities[k] = c * x - s * y, s * x + c * y, z
                self.yaws[k] += STEP * turn
            self.places += STEP * self.velocities
        return sent

    def _situation(self, k: int) -> Situation:
        half = 0.5 * self.yaws[k]
        x, y, z = self.places[k].tolist()
        u, v, w = self.velocities[k].tolist()
        pose = Pose(self.now_ns, (x, y, z), (u, v, w), (math.cos(half), 0.0, 0.0, math.sin(half)))
        return Situation(pose, heard=True, airborne=True, obeys=True, limits=LIMITS)

    @property
    def error(self) -> float:
        """Return the rms error of the bearings as people see it, deg."""
        errors = np.array(list(self.squad.errors.values()))
        return float(np.sqrt((errors**2).mean()))


@pytest.fixture
def sky() -> Sky:
    """Return a formation that has converged."""
    sky = Sky()
    sky.fly(4.0)
    return sky


def test_it_converges_and_is_moved_turned_and_grown_by_a_person(sky: Sky) -> None:
    assert sky.error < 1.5
    assert sky.squad.flying == [0, 1, 2, 3]
    assert sky.squad.eigenvalue > 0.1
    before, size = sky.places.mean(axis=0), np.ptp(sky.places, axis=0)[2]
    yaws = sky.yaws.copy()
    sky.fly(2.0, NullMotion((0.3, 0.0, 0.1), 0.2, 0.05))
    assert sky.places.mean(axis=0) - before == pytest.approx(
        [0.6 * math.cos(yaws[0] + 0.2), 0.6 * math.sin(yaws[0] + 0.2), 0.2], abs=0.06
    )
    assert sky.yaws - yaws == pytest.approx(np.full(4, 0.4), abs=0.06)
    assert np.ptp(sky.places, axis=0)[2] / size == pytest.approx(math.exp(0.1), abs=0.05)
    assert sky.error < 1.5
    assert sky.told == []


def test_one_that_does_not_obey_gets_no_sticks_and_the_others_go_on_until_it_returns(
    sky: Sky,
) -> None:
    def lands(k: int, one: Situation) -> Situation:
        return Situation(one.pose, heard=True, airborne=True) if k == 0 else one

    sent = sky.fly(1.5, NullMotion((0.2, 0.0, 0.0)), lands)
    assert all(set(one) == {1, 2, 3} for one in sent)
    assert set(sky.told) == {"formation: quad1 has left"}
    assert sky.velocities[1][0] == pytest.approx(0.2, abs=0.15), "another leads"
    sky.told.clear()
    sky.fly(4.0)
    assert set(sky.told) == {"formation: quad1 is heard again"}
    assert sky.error < 1.5


def test_one_that_was_never_there_or_stands_is_no_reason_to_stop() -> None:
    sky = Sky()

    def missing(k: int, one: Situation) -> Situation:
        return Situation() if k == 3 else one

    sky.fly(1.5, change=missing)
    assert sky.squad.flying == [0, 1, 2]
    assert sky.told == []
    sky.fly(1.0, change=lambda k, one: Situation(one.pose, heard=True) if k == 3 else one)
    sky.told.clear()
    sky.fly(2.0, NullMotion((0.2, 0.0, 0.0)), missing)
    assert np.linalg.norm(sky.velocities[:3], axis=1).min() > 0.1
    assert not [line for line in sky.told if "stops" in line]


def test_one_that_is_lost_in_the_air_stops_the_others_and_is_named(sky: Sky) -> None:
    sky.fly(2.0, NullMotion((0.2, 0.0, 0.0)), lambda k, one: Situation() if k == 2 else one)
    assert np.abs(sky.velocities).max() < 1e-9
    assert any(line.startswith("formation: quad3 is neither heard nor seen") for line in sky.told)
    sky.told.clear()


def test_one_whose_link_is_cut_but_that_is_seen_is_left_out_and_named(sky: Sky) -> None:
    sky.fly(1.5, change=lambda k, one: Situation(one.pose) if k == 2 else one)
    assert sky.squad.flying == [0, 1, 3]
    assert set(sky.told) == {"formation: quad3 is silent; it is left out"}
    assert sky.squad.eigenvalue > 0.1


def test_a_formation_that_cannot_be_flown_is_refused() -> None:
    options = FormationOptions(desired="1 2 0 0")
    with pytest.raises(UsageError, match="not rigid"):
        Squad(NAMES, options, lambda _, line: None)


def test_a_loop_that_is_late_leaves_the_vehicles_seeing_each_other(sky: Sky) -> None:
    for _ in range(5):
        sky.now_ns += 300_000_000
        sky.fly(STEP)
    assert len(sky.squad.errors) == 12
    assert sky.error < 2.0
    assert sky.told == []
