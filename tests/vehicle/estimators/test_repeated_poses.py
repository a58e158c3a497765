"""A tracker that repeats its last pose with new stamps, whole or in part."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from benchmarks.flights.watched_flight import WatchedFlight
from quadrotor.records import NO_ATTITUDE, POSE_SAMPLE, Record, new_state, pose_sample
from tests.support.narrowing import now
from vehicle.estimators.repeated_poses import RepeatedPoses

MS = 1_000_000
PERIOD = 10 * MS


class Tracked:
    """Poses at 100 Hz of a vehicle that moves at `speed` (m/s) and turns at `rate` (rad/s)."""

    def __init__(self, speed: float = 1.0, rate: float = 0.5) -> None:
        self.lines: list[str] = []
        self.judge = RepeatedPoses(lambda line, _: self.lines.append(line))
        self.state = new_state()
        self.state["velocity_w"][0, 0], self.state["angular_velocity_b"][0, 2] = speed, rate
        self.count = 0
        self._place, self._turn = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0)

    def send(self, frames: int, *, frozen: str = "", airborne: bool = True) -> list[bool]:
        """Send poses of which these parts are frozen; return which were taken."""
        taken = []
        for _ in range(frames):
            self.count += 1
            if "position" not in frozen:
                self._place = (0.01 * self.count, 0.0, 1.0)
            if "attitude" not in frozen:
                half = 0.001 * self.count
                self._turn = (float(np.cos(half)), 0.0, 0.0, float(np.sin(half)))
            sample = pose_sample(self.count * PERIOD, self._place, self._turn)
            taken.append(self.judge.takes(sample, self.state, airborne))
        return taken


def test_poses_that_change_are_taken() -> None:
    tracked = Tracked()
    assert all(tracked.send(200))
    assert tracked.lines == []


def test_a_whole_pose_that_repeats_is_missing_from_the_first_copy_on_and_told_after_0_1_s() -> None:
    tracked = Tracked(speed=0.0, rate=0.0)
    tracked.send(10)
    assert not any(tracked.send(9, frozen="position attitude"))
    assert tracked.lines == []  # a network that sends each pose twice is no fault
    assert not any(tracked.send(20, frozen="position attitude"))
    assert len(tracked.lines) == 1
    assert "repeats its last pose with new stamps" in tracked.lines[0]
    assert all(tracked.send(5))
    assert now(tracked).lines[1:] == ["the tracker's pose changes again"]


@pytest.mark.parametrize("part", ["position", "attitude"])
def test_a_part_that_repeats_while_the_vehicle_moves_is_frozen_after_0_1_s(part: str) -> None:
    tracked = Tracked()
    tracked.send(10)
    taken = tracked.send(30, frozen=part)
    assert taken == [True] * 9 + [False] * 21
    assert f"repeats its last {part}" in tracked.lines[0]


@pytest.mark.parametrize("part", ["position", "attitude"])
def test_coarse_numbers_of_a_vehicle_at_rest_may_repeat_for_half_a_second(part: str) -> None:
    tracked = Tracked(speed=0.02, rate=0.02)
    tracked.send(10)
    taken = tracked.send(60, frozen=part)
    assert taken == [True] * 49 + [False] * 11


def test_on_the_ground_everything_may_repeat() -> None:
    tracked = Tracked(speed=0.0, rate=0.0)
    assert all(tracked.send(500, frozen="position attitude", airborne=False))
    assert not any(tracked.send(5, frozen="position attitude"))


def test_a_marker_has_no_attitude_that_could_freeze() -> None:
    judge, state = RepeatedPoses(lambda *_: None), new_state()
    state["angular_velocity_b"][0, 2] = 1.0
    for k in range(100):
        sample = pose_sample(k * PERIOD, (0.01 * k, 0.0, 1.0), NO_ATTITUDE)
        assert judge.takes(sample, state, True)


@pytest.fixture(scope="module")
def freeze() -> Callable[[float], WatchedFlight]:
    """Return `freeze(seconds)`: a flight of the 8 whose tracker repeated itself for so long."""

    def fly(seconds: float) -> WatchedFlight:
        flight = WatchedFlight(3).hover(1.0)
        flight.start("follow_trajectory", trajectory="figure_eight", laps=3)
        flight.wait(4.0)
        stack: Any = flight.stack
        measure, kept = stack.measure, list[Record]()

        def repeated(message: Any) -> None:
            if isinstance(message, np.ndarray) and message.dtype == POSE_SAMPLE:
                kept.append(message)
                message = message.copy()
                for field in ("position_w", "quaternion_wb"):
                    message[field] = kept[0][field]
            measure(message)

        stack.measure = repeated
        flight.run(seconds)
        stack.measure = measure
        return flight

    return fly


def test_the_vehicle_flies_on_through_half_a_second(
    freeze: Callable[[float], WatchedFlight],
) -> None:
    flight = freeze(0.5)
    flight.run(3.0)
    times, true, wanted = flight.trace(flight.robot.stamp_ns * 1e-9 - 3.5)
    assert np.linalg.norm(true - wanted, axis=1).max() < 0.1, len(times)
    assert flight.view().behavior == "follow_trajectory"
    assert any("repeats its last pose" in text for text in flight.events.texts)


def test_the_vehicle_lands_when_it_lasts(freeze: Callable[[float], WatchedFlight]) -> None:
    flight = freeze(1.5)
    assert flight.view().mode == "emergency_land"
    assert flight.down()
    assert flight.hardest < 0.7
