"""A presumed touch-down, tested by taking thrust away: on the ground, and in moving air."""

from __future__ import annotations

import math

import pytest

from benchmarks.flights.watched_flight import WatchedFlight
from benchmarks.onboard.landings import Disturbance, hovering, land
from quadrotor.vehicle_model import GRAVITY
from vehicle.safety.ground_contact import GroundContact
from vehicle.safety.unloading import MOST, Unloading, Verdict

DT = 0.002


def judged(
    carried: float, *, ground: bool, learnt: float = 1.0, shaken: float = 0.0, phase: float = 0.0
) -> tuple[Verdict, float]:
    """Return the verdict on a vehicle, and after how many seconds it came.

    Args:
        carried: share of the weight that something else than the motors carries at first.
        ground: whether that is the ground, which carries what the motors no longer do.
        learnt: what a thrust is taken to give, over what it gives.
        shaken: amplitude, in weights, of a vibration of 12 Hz. phase: of it, rad.
    """
    test, thrust = Unloading(), 1.0 - carried
    for _ in range(500):
        test.observe(GRAVITY, learnt * GRAVITY * thrust, DT)
    given = thrust
    for k in range(1000):
        given += DT / 0.04 * (max(0.3, thrust - test.share) - given)  # the motors follow
        lift = 1.0 if ground else given + carried
        lift += shaken * math.sin(75.0 * k * DT + phase)
        test.observe(GRAVITY * lift, learnt * GRAVITY * max(0.3, thrust - test.share), DT)
        if (verdict := test.step(DT)) is not Verdict.OPEN:
            return verdict, k * DT
    raise AssertionError("no verdict")


@pytest.mark.parametrize("carried", [0.0, 0.1, 0.4, 0.69])
def test_the_ground_carries_what_the_motors_no_longer_give(carried: float) -> None:
    verdict, time = judged(carried, ground=True)
    assert verdict is Verdict.GROUND
    assert time < 0.35


@pytest.mark.parametrize("carried", [0.0, 0.4, 0.69])
@pytest.mark.parametrize("learnt", [0.8, 1.6, 2.5])
def test_the_ground_is_found_although_what_a_thrust_gives_was_learnt_wrong(
    carried: float, learnt: float
) -> None:
    assert judged(carried, ground=True, learnt=learnt)[0] is Verdict.GROUND


@pytest.mark.parametrize("carried", [-0.3, 0.0, 0.1, 0.25, 0.45])
def test_the_air_does_not_however_strong_the_updraught(carried: float) -> None:
    verdict, time = judged(carried, ground=False)
    assert verdict is Verdict.AIR
    assert time <= 0.4


@pytest.mark.parametrize("phase", [1.5, 2.5, 3.5, 4.5])
def test_a_vibration_does_not_hide_a_fall(phase: float) -> None:
    assert judged(0.0, ground=False, shaken=0.7, phase=phase)[0] is Verdict.AIR
    assert judged(0.3, ground=True, shaken=0.1, phase=phase)[0] is Verdict.GROUND


@pytest.mark.parametrize("phase", [0.5 * k for k in range(13)])
@pytest.mark.parametrize("ground", [False, True])
def test_a_vehicle_that_shakes_is_judged_by_its_mean_although_its_thrust_is_low_already(
    phase: float, ground: bool
) -> None:
    test, thrust = Unloading(), 1.0
    for k in range(-1000, 300):
        if k == -60:
            thrust = 0.4  # 0.12 s before the test
        lift = (1.0 if ground else thrust) + 0.5 * math.sin(75.0 * k * DT + phase)
        test.observe(GRAVITY * lift, GRAVITY * max(0.3, thrust - test.share), DT)
        if k >= 0 and (verdict := test.step(DT)) is not Verdict.OPEN:
            break
    assert verdict is (Verdict.GROUND if ground else Verdict.AIR)


def test_all_thrust_comes_back_at_the_end() -> None:
    test = Unloading()
    for _ in range(200):
        test.observe(GRAVITY, GRAVITY, DT)
        test.step(DT)
    assert test.share == MOST
    assert test.is_running
    test.end()
    assert test.share == 0.0
    assert not test.is_running


def test_a_reading_that_is_no_number_does_not_outlast_its_sample() -> None:
    test, ground = Unloading(), GroundContact()
    for lift in (GRAVITY, math.nan, *[GRAVITY] * 1000):
        test.observe(lift, 0.3 * GRAVITY, DT)
        ground.observe(lift, 10.0, 0.1, DT)
    assert ground.lift_per_newton == pytest.approx(GRAVITY / 10.0)
    verdicts = [test.step(DT) for _ in range(20)]
    assert Verdict.GROUND in verdicts
    assert Verdict.AIR not in verdicts


def test_an_accelerometer_that_repeats_its_reading_shows_nothing() -> None:
    test, blind = Unloading(), []
    for lift in (*[GRAVITY] * 61, 1.01 * GRAVITY):
        test.observe(lift, GRAVITY, DT)
        blind.append(test.is_blind)
    assert blind == [False] * 60 + [True, False], "calm axes stay the same for some samples"


CASES = {
    "a push of 11 % of the weight": Disturbance("push", {"push_z": 1.4}, 1.5, 0.3),
    "a released payload": Disturbance(
        "payload off", {"payload": 0.0}, 1.0, before={"payload": 0.15}
    ),
    "an updraught": Disturbance("updraught", {"wind_z": 5.0}, 1.0),
    "a stronger updraught": Disturbance("updraught", {"wind_z": 8.0}, 1.5),
    "12 % more thrust": Disturbance("thrust", {"thrust_efficiency": 1.12}, 1.0),
    "a lasting force": Disturbance("step", {"push_z": 3.0}, 1.2),
}


@pytest.fixture(scope="module")
def flight() -> WatchedFlight:
    """Return a hovering flight, of which each landing is a copy."""
    return hovering(1)


def test_what_lifts_a_landing_vehicle_is_not_taken_for_the_ground(flight: WatchedFlight) -> None:
    descents = [(name, "land") for name in CASES] + [("a released payload", "emergency_landing")]
    refuted = 0
    for name, behavior in descents:
        found = land(flight, CASES[name], behavior)
        refuted += found.refuted
        assert not found.is_in_the_air, (name, behavior, found)
        assert found.impact < 0.7, (name, behavior, found)
        assert found.told is not None, (name, behavior, found)
    assert refuted >= len(descents) // 2, "what looks like the ground and is none is told"


@pytest.mark.parametrize("behavior", ["land", "emergency_landing"])
def test_a_stuck_accelerometer_is_no_witness_of_the_ground(
    flight: WatchedFlight, behavior: str
) -> None:
    """A stuck reading shows the weight at rest, however little the motors give."""
    stuck = Disturbance("none", {"faults": "imu.stuck sensor=accelerometer axis=z"}, 0.5)
    found = land(flight, stuck, behavior)
    assert found.contact is not None
    assert found.told is not None, "the landing ends nevertheless"
    assert not found.is_in_the_air, found
    assert found.impact < 0.8, found
    assert found.told - found.contact < 1.5


def test_a_vibration_neither_looks_like_the_ground_nor_hides_it(flight: WatchedFlight) -> None:
    """The gain of the thrust is learnt from the mean, as readings vary more than a touch-down."""
    found = land(flight, Disturbance("none", {"vibration": 7.0}))
    assert found.refuted == 0, found
    assert not found.is_in_the_air, found
    assert found.contact is not None
    assert found.told is not None
    assert found.told - found.contact < 0.6, found
    assert found.impact < 0.7, found


def test_a_hard_touch_down_is_recognised_although_the_climb_rate_is_wrong_after_it() -> None:
    """The blow is beyond the accelerometer's range, and the vehicle may bounce."""
    flight = hovering(11)
    pushed = Disturbance("step", {"push_z": -2.172}, 2.32)
    loaded = Disturbance("payload on", {"payload": 0.092}, 0.155)
    for disturbed, behavior, slope in (
        (pushed, "emergency_landing", 0.0),
        (pushed, "silent", 0.0),
        (loaded, "emergency_landing", -1.6),
    ):
        found = land(flight, disturbed, behavior, {"ground_slope": slope})
        assert found.told is not None, found
        assert found.contact is not None, found
        assert not found.is_in_the_air, found
        assert found.told - found.contact < 0.45, (behavior, found)


def test_a_calm_touch_down_is_recognised_at_once() -> None:
    found = land(hovering(2), Disturbance("none", {}))
    assert found.refuted == 0
    assert found.told is not None
    assert found.contact is not None
    assert found.told - found.contact < 0.6
