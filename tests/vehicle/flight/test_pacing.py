"""Wake-ups of the loop, periods without a sample, and stamps finer than a millisecond."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from quadrotor.records import POSE_SAMPLE, Record
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.boards.mikrokopter.sample_stamps import MS, FineStamps
from vehicle.flight.pacing import GIVE_UP_NS, Deadlines, MemoryPacer, PortPacer
from vehicle.simulator.in_process import InProcessRobot

PERIOD = 2 * MS
DELAY = 1_234_567


class Line:
    """Line with samples every 2 ms, some late, some lost; checks the deadlines every 0.5 ms."""

    def __init__(self, late: dict[int, int] | None = None, lost: tuple[int, ...] = ()) -> None:
        self.deadlines = Deadlines(PERIOD)
        count = 200
        waiting = [k for k in range(count) if k not in lost]
        for now in range(0, count * PERIOD, MS // 2):
            heard = False
            while waiting and waiting[0] * PERIOD + DELAY + (late or {}).get(waiting[0], 0) <= now:
                self.deadlines.met(waiting.pop(0) * PERIOD, now)
                heard = True
            if not heard:
                self.deadlines.check(now)


def test_samples_in_time_miss_no_period() -> None:
    assert Line().deadlines.missed == 0


def test_a_sample_a_little_late_is_none_that_is_missed() -> None:
    assert Line(late={50: PERIOD - MS}).deadlines.missed == 0


def test_each_lost_sample_is_one_period_missed() -> None:
    assert Line(lost=(50, 90, 91, 92)).deadlines.missed == 4


def test_a_sample_later_than_a_period_is_missed_though_it_comes() -> None:
    assert Line(late={50: 3 * PERIOD // 2}).deadlines.missed == 1


def test_a_silence_goes_on_counting_and_its_end_counts_nothing_twice() -> None:
    deadlines = Deadlines(PERIOD)
    for k in range(10):
        deadlines.met(k * PERIOD, k * PERIOD + DELAY)
    deadlines.check(19 * PERIOD + DELAY)
    assert deadlines.missed == 9  # of the samples 10 … 18, a period after each was due
    deadlines.met(20 * PERIOD, 20 * PERIOD + DELAY)
    assert deadlines.missed == 10


def test_a_first_sample_that_came_late_does_not_hide_later_ones() -> None:
    deadlines = Deadlines(PERIOD)
    deadlines.met(0, 7 * PERIOD)
    for k in range(1, 8):
        deadlines.met(k * PERIOD, 7 * PERIOD)
    missed = deadlines.missed
    for k in range(8, 50):
        deadlines.met(k * PERIOD, k * PERIOD)
    deadlines.check(51 * PERIOD - 1)
    assert deadlines.missed == missed
    deadlines.check(51 * PERIOD + PERIOD // 100)
    assert deadlines.missed == missed + 1


def test_clocks_that_drift_apart_miss_nothing() -> None:
    deadlines = Deadlines(PERIOD)
    for k in range(60 * 500):
        deadlines.met(k * PERIOD, round(k * PERIOD * (1 + 80e-6)))
    assert deadlines.missed == 0


@pytest.mark.parametrize("rate", [60, 240, 400, 500, 650, 677, 1000])
@pytest.mark.parametrize("phase", [0, 300_000, 999_999])
def test_time_steps_become_the_period_whatever_the_milliseconds_say(rate: int, phase: int) -> None:
    period = 1000 * round(1e6 / rate)
    stamps = FineStamps(period)
    errors = []
    for k in range(200):
        taken = phase + k * period
        if k in (100, 150, 151):
            continue  # lost
        stamp = taken // MS * MS
        fine = stamps.refine(stamp)
        assert stamp <= fine < stamp + MS
        errors.append(taken - fine)
    steps = np.diff(errors[20:])  # lost samples included
    assert np.abs(steps).max() < 0.05 * period
    assert phase or not steps.any()


def test_a_clock_off_by_a_percent_is_followed() -> None:
    stamps = FineStamps(1_538_000)
    for k in range(3000):
        stamp = round(k * 1_553_000) // MS * MS
        assert stamp <= stamps.refine(stamp) < stamp + MS


class Robot:
    """Source of samples every 2 ms; the work takes a given time."""

    def __init__(self, clock: list[int]) -> None:
        self.stamp_ns, self.work_ns, self.skipped = -PERIOD, 100_000, 0
        self._clock = clock

    def step(self) -> None:
        self.stamp_ns += PERIOD
        self._clock[0] += self.work_ns

    def skip(self, samples: int) -> None:
        self.skipped += samples
        self.stamp_ns += samples * PERIOD


def test_in_memory_each_sample_waits_for_its_own_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, slept = [1_000_000_000], []

    def sleep(seconds: float) -> None:
        slept.append(seconds)
        clock[0] += round(seconds * 1e9) + 50_000  # wakes late

    monkeypatch.setattr(time, "monotonic_ns", lambda: clock[0])
    monkeypatch.setattr(time, "sleep", sleep)
    robot = Robot(clock)
    start = clock[0] + 5 * MS
    pacer = MemoryPacer(robot, PERIOD, start)
    woken = []
    for _ in range(100):
        pacer.wait()
        woken.append(clock[0])
    assert woken == [start + k * PERIOD + 50_000 for k in range(100)]  # lateness does not add up
    robot.work_ns = 3 * PERIOD
    pacer.wait()
    robot.work_ns = 100_000
    count = len(slept)
    pacer.wait()
    assert len(slept) == count, "behind: no sleep until it has caught up"
    clock[0] += 2 * GIVE_UP_NS
    pacer.wait()
    assert robot.skipped * PERIOD > 2 * GIVE_UP_NS - PERIOD
    assert abs(clock[0] - pacer.due_ns) < 2 * PERIOD


def test_behind_ports_the_loop_waits_until_bytes_come_or_the_sample_is_overdue() -> None:
    reader, writer = os.pipe()

    class Ports:
        lost_ports = 0

        def filenos(self) -> tuple[int, ...]:
            return (reader,)

    try:
        pacer = PortPacer(Ports(), PERIOD)
        now = time.monotonic_ns()
        pacer.deadlines.met(0, now)
        pacer.wait()
        assert time.monotonic_ns() >= now + 2 * PERIOD
        pacer.deadlines.overdue_ns = time.monotonic_ns() + 10**12
        os.write(writer, b"#")
        pacer.wait()
    finally:
        os.close(reader)
        os.close(writer)


def test_a_vehicle_in_process_gives_a_sample_a_step_and_poses_of_the_same_clock() -> None:
    measured: list[Record] = []
    robot = InProcessRobot(1000, measured.append)
    robot.epoch_ns = 5_000_000_000
    mcu = Microcontroller(robot.ports, robot.epoch_ns, rate=1000)
    stamps = []
    for _ in range(25):
        robot.step()
        stamps += [sample.stamp_ns for sample in mcu.receive()]
    assert stamps == [robot.epoch_ns + k * MS for k in range(25)]
    assert [sample.dtype for sample in measured] == [POSE_SAMPLE] * 3
    assert {int(sample["stamp_ns"][0]) for sample in measured} <= set(stamps)
