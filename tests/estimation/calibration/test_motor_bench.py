"""Sec. 5.3: the bench's schedule, its means, both laws and the lag."""

from __future__ import annotations

import numpy as np
import pytest

from estimation.calibration.motor_bench import BenchSchedule, average_steps
from estimation.calibration.motor_law import identify_motor
from quadrotor.errors import MeasurementError

SLOPE, OFFSET, RATIO, LAG = 0.0126403, 14.267, 0.0174, 0.047
PERIOD = 0.01


class Bench:
    """Motor on a force/torque sensor, recorded at 100 Hz."""

    def __init__(self, rng: np.random.Generator, schedule: BenchSchedule | None = None) -> None:
        self.schedule = schedule or BenchSchedule()
        self.time = np.arange(0.0, self.schedule.duration, PERIOD)
        self.reference = np.array([self.schedule.reference(t) for t in self.time])
        share, speed = 1.0 - np.exp(-PERIOD / LAG), self.reference[0]
        speeds = []
        for reference in self.reference:
            speeds.append(speed)
            speed += share * (reference - speed)
        self.speed = np.array(speeds) + OFFSET
        force = np.square(SLOPE * self.speed)
        self.force = force + 0.02 * rng.standard_normal(len(force))
        self.torque = RATIO * force + 0.0005 * rng.standard_normal(len(force))


@pytest.fixture
def bench(rng: np.random.Generator) -> Bench:
    return Bench(rng)


def test_the_schedule_is_the_papers() -> None:
    schedule = BenchSchedule()
    assert schedule.references == tuple(range(30, 200, 10))
    assert schedule.duration == 17 * 15.0
    assert [schedule.reference(t) for t in (0.0, 9.99, 10.0, 14.99, 15.0, 25.0)] == [
        25,
        25,
        30,
        30,
        25,
        40,
    ]
    assert schedule.reference(schedule.duration) == 25
    assert schedule.hold_of(16) == (250.0, 255.0)


def test_seventeen_steps_give_the_law_to_a_fifth_of_a_count(bench: Bench) -> None:
    steps = average_steps(bench.schedule, bench.time, bench.force, bench.torque)
    found = identify_motor(steps)
    forces = np.linspace(0.3131, 6.03, 50)
    truth = np.sqrt(forces) / SLOPE - OFFSET
    assert np.abs(np.sqrt(forces) / found.slope - found.offset - truth).max() < 0.2
    assert found.torque_ratio == pytest.approx(RATIO, rel=0.005)
    assert found.root.worst < 0.3
    assert found.quadratic.worst > 5.0, "the paper's fit misses by counts"
    assert (found.thrust_min, found.thrust_max) == pytest.approx((0.3131, 6.03), rel=0.005)
    assert found.steps.reference.max() == 180.0, "190 is beyond the usable range"


def test_an_unplugged_sensor_names_the_step(bench: Bench) -> None:
    force = np.where(bench.time > 100.0, np.nan, bench.force)
    with pytest.raises(MeasurementError, match=r"step 90 has 0 force samples.*plugged in"):
        average_steps(bench.schedule, bench.time, force, bench.torque)


def test_a_force_that_falls_or_a_wrong_sign_is_refused(bench: Bench) -> None:
    steps = average_steps(bench.schedule, bench.time, -bench.force, bench.torque)
    with pytest.raises(MeasurementError, match=r"at 30 counts is -0.31.*sign and zero"):
        identify_motor(steps)


def test_too_few_steps_are_refused(rng: np.random.Generator) -> None:
    bench = Bench(rng, BenchSchedule(first=30, last=60))
    steps = average_steps(bench.schedule, bench.time, bench.force, bench.torque)
    with pytest.raises(MeasurementError, match="4 steps between 30 and 180"):
        identify_motor(steps)
