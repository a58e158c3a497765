"""Instructions of guided calibrations to the person at the vehicle, and reasons to give up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from console.evaluation.accelerometer import raw_of, up_of
from console.experiments.accelerometer import Accelerometer
from console.experiments.client import ExperimentEndedError, VehicleView
from console.experiments.motor_bench import MotorBench
from console.experiments.pose_guide import attitude_of, spread_poses, words_of
from console.experiments.readings import BenchReadings, ImuReadings, Progress, TrackedAttitude
from console.experiments.watched import AbortedError, fly
from quadrotor.errors import RefusedError

RATE = 200.0
FACES = {"upright": (0, 0, 1), "nose up": (1, 0, 0), "left side up": (0, 1, 0)}


class Person:
    """Client whose vehicle is held according to a list of (seconds, world z in body axes)."""

    simulated, finished, has_pilot = False, False, False

    def __init__(self, held: Sequence[tuple[float, Sequence[float]]], tracker: bool = True) -> None:
        self.time, self.held, self.tracker = 100.0, list(held), tracker
        self.mode, self.armed = "ready", False
        self.told: list[Progress] = []
        self.turned: list[Any] = []
        self.benched: list[tuple[int, int]] = []
        self.answers: ExperimentEndedError | None = None
        self._looked = self.time

    def view(self) -> VehicleView:
        return VehicleView(self.time, self.mode, "ground", self.armed, False, np.zeros(3))

    def parameter(self, name: str) -> float:
        return 1.0 if name[-2:] in ("xx", "yy", "zz") else 0.0

    def wait(self, seconds: float) -> None:
        self.time += seconds

    def wait_until(self, condition: Any, *, what: str, timeout: float) -> None:
        while not condition(self.view()):
            self.time += 0.01

    def tell(self, progress: Progress) -> None:
        self.told.append(progress)

    def confirm(self, question: str) -> None:
        if self.answers is not None:
            raise self.answers

    def turn(self, quaternion_wb: Any) -> None:
        self.turned.append(quaternion_wb)

    def bench(self, motor: int, reference: int) -> None:
        self.benched.append((motor, reference))

    def bench_readings(self) -> BenchReadings:
        return BenchReadings(*np.zeros((4, 0)))

    def up(self, time: float) -> tuple[np.ndarray, bool]:
        """Return world z in body axes, and whether the vehicle turns."""
        since = time - 100.0
        for seconds, up in self.held:
            if since < seconds:
                return np.array(up, float) / np.linalg.norm(up), since < 0.3
            since -= seconds
        return np.array((0.0, 0.0, 1.0)), False

    def imu(self) -> ImuReadings:
        times = np.arange(self._looked, self.time - 1e-9, 1.0 / RATE)
        self._looked = self.time
        ups = [self.up(time) for time in times]
        forces = np.array([9.81 * up for up, _ in ups]).reshape(-1, 3)
        rates = np.array([(1.0 if turning else 0.0, 0, 0) for _, turning in ups]).reshape(-1, 3)
        return ImuReadings(times, forces, rates, np.zeros((0, 4)), np.zeros((0, 4)))

    def tracked(self) -> TrackedAttitude | None:
        if not self.tracker:
            return None
        return TrackedAttitude(self.time, np.array(attitude_of(self.up(self.time)[0])))

    def said(self) -> str:
        return " | ".join(dict.fromkeys(progress.instruction for progress in self.told))


def accelerometer(**options: object) -> Accelerometer:
    experiment = Accelerometer()
    for name, value in ({"patience": 10.0, "hold": 0.5} | options).items():
        setattr(experiment.parameters, name, value)
    return experiment


def test_directions_and_attitudes_are_inverse_and_told_in_words() -> None:
    for up in spread_poses(20, 1.5):
        assert up_of(np.array(attitude_of(up))) == pytest.approx(up, abs=1e-12)
    assert words_of(np.array((0.0, 0.0, 1.0))) == "level"
    assert words_of(np.array((0.5, -0.5, np.sqrt(0.5)))) == "nose up by 30°, right side up by 30°"
    assert words_of(np.array((0.0, 0.0, -1.0))) == "level, upside down"


def test_poses_are_spread_within_the_tilt() -> None:
    poses = spread_poses(12, np.radians(70.0))
    assert np.degrees(np.arccos(poses[:, 2])).max() == pytest.approx(70.0)
    nearness = poses @ poses.T - 2.0 * np.eye(12)
    assert np.degrees(np.arccos(nearness.max())) > 30.0


def test_raw_readings_are_those_before_the_calibration(rng: np.random.Generator) -> None:
    matrix, bias = np.eye(3) + 0.05 * rng.standard_normal((3, 3)), rng.standard_normal(3)
    raw = 9.81 * rng.standard_normal((50, 3))
    assert raw_of((raw - bias) @ matrix.T, matrix, bias) == pytest.approx(raw)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def test_a_face_that_is_none_or_done_is_told_and_not_taken() -> None:
    person = Person(
        [(1.5, (0, 0, 1)), (1.5, (1, 0, 1)), (1.5, (0, 0, 1)), (1.5, (1, 0, 0))], tracker=False
    )
    experiment = accelerometer(method="faces")
    with pytest.raises(RefusedError, match=r"no new pose was held still for 10 s .*; 2 were taken"):
        experiment.fly(person)  # type: ignore[arg-type]
    assert "45° from" in person.said()
    assert "'upright' is done already. Hold the vehicle" in person.said()
    assert person.turned[-1] is None, "it is let go of"


def test_without_the_tracker_a_pose_is_not_taken_and_the_reason_is_told() -> None:
    person = Person([(1.5, (0, 0, 1)), (1.5, (1, 0, 1))], tracker=False)
    with pytest.raises(
        RefusedError, match=r"0 were taken, which is not enough\. Nothing was changed"
    ):
        accelerometer().fly(person)  # type: ignore[arg-type]
    assert "the tracker does not see the vehicle" in person.said()


def test_poses_come_by_themselves_with_rank_condition_and_the_next_one() -> None:
    person = Person([(1.5, up) for up in spread_poses(6, 1.2)])
    accelerometer(poses=6).fly(person)  # type: ignore[arg-type]
    ranks = [p.live["rank"][0] for p in person.told if p.live]
    assert ranks == sorted(ranks)
    last = [progress for progress in person.told if progress.live][-1].live
    assert {"condition number", "pose 5 z", "next x"} <= last.keys()
    assert person.told[-1].instruction == "Set the vehicle down, level"


def test_motors_that_are_switched_on_end_it() -> None:
    person = Person([(9.0, (0, 0, 1))])
    tell = person.tell

    def arm(progress: Progress) -> None:
        tell(progress)
        if progress.count:
            person.mode, person.armed = "armed", True

    person.tell = arm  # type: ignore[method-assign]
    with pytest.raises(RefusedError, match="the vehicle is armed; motors must be off while it is"):
        accelerometer().fly(person)  # type: ignore[arg-type]


# ---------------------------------------------------------------- motor bench
def test_no_motor_turns_before_somebody_said_yes() -> None:
    person = Person([])
    person.answers = ExperimentEndedError("stopped by anna")
    with pytest.raises(ExperimentEndedError):
        MotorBench().fly(person)  # type: ignore[arg-type]
    assert not person.benched


def test_a_silent_sensor_ends_the_bench() -> None:
    person = Person([])
    with pytest.raises(RefusedError, match=r"sends nothing for 1 s .*the motor is stopped. Plug"):
        MotorBench().fly(person)  # type: ignore[arg-type]
    assert person.benched == [(1, 25), (0, 0)]
    assert person.time < 103.0


# ---------------------------------------------------------------- abort rule
class Rule:
    """Experiment that waits, with a rule about the time."""

    name, parameters, planned = "rule", None, 1.0

    def check(self) -> None: ...

    def preconditions(self, view: VehicleView) -> str:
        return ""

    def abort(self, view: VehicleView) -> str:
        return "too late" if view.time > 101.0 else ""

    def fly(self, client: Any) -> None:
        client.wait(30.0)

    def evaluate(self, log: object) -> None: ...


def test_the_abort_rule_is_looked_at_during_a_plain_wait() -> None:
    person = Person([])
    with pytest.raises(AbortedError, match="aborted: too late"):
        fly(Rule(), person)  # type: ignore[arg-type]
    assert person.time == pytest.approx(101.0, abs=0.1)
