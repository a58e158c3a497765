"""The watch over descents by the barometer, with made-up motions."""

from __future__ import annotations

import pytest

from quadrotor.vehicle_model import GRAVITY
from vehicle.safety.barometric_height import PASCALS_PER_METRE, BarometricHeight
from vehicle.safety.blind_descent import DOUBT_LASTS, FASTER, REMEMBERED, SPARE, BlindDescent

DT, GROUND, SPEED, BIAS = 0.002, 96_000.0, 0.5, 0.08


class Descent:
    """A vehicle that hovers at 2 m with poses, and then sinks at SPEED as it is told to."""

    def __init__(self, known_by_poses: bool = True) -> None:
        self.altitude, self.lines = BarometricHeight(), list[str]()
        self.watch = BlindDescent(self.altitude, self.lines.append)
        self.altitude.set_ground(GROUND, DT)
        self.height, self.time = 2.0, 0.0
        for _ in range(round(60.0 / DT)):
            self.altitude.step(self.pressure(0.0), GRAVITY + BIAS, DT)
            motion = (self.height, 0.0) if known_by_poses else None
            self.watch.follow(GRAVITY + BIAS, motion, DT)

    def pressure(self, leak: float) -> float:
        return GROUND - PASCALS_PER_METRE * self.height + leak * self.time

    def sink(self, seconds: float, leak: float = 0.0) -> None:
        for _ in range(round(seconds / DT)):
            self.time += DT
            self.height -= SPEED * DT
            lift = GRAVITY + BIAS - (SPEED / DT if self.time < 1.5 * DT else 0.0)
            self.altitude.step(self.pressure(leak), lift, DT)
            self.watch.watch(lift, SPEED, DT)


def test_a_barometer_that_agrees_is_believed() -> None:
    descent = Descent()
    descent.sink(4.0)
    assert descent.lines == []
    assert descent.altitude.is_believed
    assert descent.altitude.climb == pytest.approx(-SPEED, abs=0.02)


@pytest.mark.parametrize("leak", [15.0, -15.0, 5.0, -5.0])
def test_a_barometer_that_leaks_is_not_believed(leak: float) -> None:
    descent = Descent()
    descent.sink(4.0, leak)
    (line,) = descent.lines
    assert line.startswith("barometer and accelerometer disagree by ")
    assert line.endswith(": descending by the accelerometer")
    assert descent.altitude.climb == pytest.approx(-SPEED, abs=0.02)
    assert descent.altitude.height == pytest.approx(descent.height, abs=0.05)
    assert descent.watch.extra == 0.0


def test_without_poses_before_it_takes_a_larger_leak() -> None:
    small, large = Descent(known_by_poses=False), Descent(known_by_poses=False)
    small.sink(3.0, 5.0)
    large.sink(3.0, 15.0)
    assert small.altitude.is_believed
    assert not large.altitude.is_believed
    assert large.altitude.climb == pytest.approx(-SPEED, abs=0.1)


def test_for_some_seconds_after_the_last_pose_a_leak_teaches_nothing() -> None:
    descent = Descent()
    for _ in range(round((REMEMBERED - 0.1) / DT)):
        descent.time += DT
        descent.altitude.step(descent.pressure(15.0), GRAVITY + BIAS, DT)
        descent.watch.follow(GRAVITY + BIAS, None, DT)
    assert descent.altitude.climb == pytest.approx(-15.0 / PASCALS_PER_METRE, abs=0.15)
    descent.watch.watch(GRAVITY + BIAS, SPEED, DOUBT_LASTS + DT)
    assert descent.altitude.climb == pytest.approx(0.0, abs=0.01)


def test_a_hard_touch_down_that_the_accelerometer_does_not_measure_is_no_leak() -> None:
    descent = Descent()
    descent.sink(1.0)
    for _ in range(8):  # it stops, and the accelerometer shows a third of it
        descent.altitude.step(descent.pressure(0.0), 2.0 * GRAVITY, DT)
        descent.watch.watch(2.0 * GRAVITY, SPEED, DT)
    for _ in range(round(4.0 / DT)):
        descent.altitude.step(descent.pressure(0.0), GRAVITY + BIAS, DT)
        descent.watch.watch(GRAVITY + BIAS, SPEED, DT)
    assert descent.lines == []
    assert descent.altitude.climb == pytest.approx(0.0, abs=0.05)


def test_an_accelerometer_that_poses_contradict_does_not_blame_the_barometer() -> None:
    doubted, believed = Descent(), Descent()
    for _ in range(round(3.0 / DT)):  # it hovers, and its accelerometer reads 0.5 m/s² too much
        for descent in (doubted, believed):
            descent.altitude.step(descent.pressure(0.0), GRAVITY + BIAS + 0.5, DT)
            if descent is believed:
                descent.watch.distrust_accelerometer()
            descent.watch.watch(GRAVITY + BIAS + 0.5, SPEED, DT)
    assert not doubted.altitude.is_believed
    assert believed.altitude.is_believed
    assert believed.lines == []


def test_a_descent_that_should_have_ended_becomes_faster() -> None:
    descent = Descent()
    descent.sink(2.0 / SPEED + 2.9)  # 1.45 m below the place of take-off
    assert descent.watch.extra == 0.0
    descent.sink(2.1)
    assert descent.lines == ["no ground where it should be: sinking faster and faster"]
    assert descent.watch.extra == pytest.approx(2.0 * FASTER, abs=0.05)
    descent.watch.follow(GRAVITY + BIAS, None, DT)
    assert descent.watch.extra == 0.0, "the next descent is as commanded"


def test_so_does_one_whose_height_does_not_change() -> None:
    descent = Descent()
    longest = SPARE + 2.0 * 2.0 / SPEED
    for _ in range(round((longest + 5.0) / 0.01)):
        descent.altitude.step(descent.pressure(0.0), GRAVITY + BIAS, 0.01)
        descent.watch.watch(GRAVITY + BIAS, SPEED, 0.01)
    assert descent.lines == ["no ground where it should be: sinking faster and faster"]
    assert descent.watch.extra == pytest.approx(5.0 * FASTER, abs=0.01)


def test_a_climb_that_began_before_it_was_found_in_the_air_is_no_bias() -> None:
    altitude, lines = BarometricHeight(), list[str]()
    watch = BlindDescent(altitude, lines.append)
    altitude.set_ground(GROUND, DT)
    watch.rest()
    height, climb = 0.0, 0.4

    def fly(seconds: float, acceleration: float, *, has_poses: bool) -> None:
        nonlocal height, climb
        for _ in range(round(seconds / DT)):
            climb += acceleration * DT
            height += climb * DT
            altitude.step(GROUND - PASCALS_PER_METRE * height, GRAVITY + acceleration, DT)
            motion = (height, climb) if has_poses else None
            watch.follow(GRAVITY + acceleration, motion, DT)

    fly(1.3, 0.0, has_poses=True)
    fly(0.4, -1.0, has_poses=False)  # it stops, and hovers blindly
    fly(2.0, 0.0, has_poses=False)
    for k in range(round(2.0 / DT)):
        height -= SPEED * DT
        lift = GRAVITY - (SPEED / DT if k == 0 else 0.0)
        altitude.step(GROUND - PASCALS_PER_METRE * height, lift, DT)
        watch.watch(lift, SPEED, DT)
    assert lines == []
    assert altitude.climb == pytest.approx(-SPEED, abs=0.1)
