"""Ground contact from take-off to rest after touch-down."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.narrowing import now
from vehicle.safety.ground_contact import TAKEN_OFF, GroundContact


def test_a_flight_from_the_ground_it_stood_on_to_rest() -> None:
    ground = GroundContact()
    ground.arm(0.4)
    ground.rise(0.4 + 0.9 * TAKEN_OFF)
    assert not ground.airborne
    ground.rise(0.4 + 1.1 * TAKEN_OFF)
    assert now(ground).airborne
    assert ground.rested(5) < 0.0
    assert ground.touch_down(2_000_000_000)
    assert not ground.airborne
    assert not ground.touch_down(2_500_000_000)  # reported once
    assert ground.rested(3_000_000_000) == pytest.approx(1.0)


def test_disarming_forgets_the_landing() -> None:
    ground = GroundContact()
    ground.arm(0.0)
    ground.touch_down(1)
    ground.disarm()
    assert ground.rested(10**10) < 0.0
    assert ground.touch_down(2)


STEP, SHARE, GRAVITY = 0.002, 0.1, 9.81


def flown(lift_per_newton: float, seconds: float = 4.0) -> GroundContact:
    """Return the contact of a vehicle that hovers with another thrust than its model's."""
    ground = GroundContact()
    ground.arm(0.0)
    ground.rise(1.0)
    for k in range(round(seconds / STEP)):
        swing = 1.0 + 0.05 * np.sin(0.01 * k)
        thrust = swing * GRAVITY / lift_per_newton
        ground.observe(lift_per_newton * thrust, thrust, SHARE, STEP)
    return ground


@pytest.mark.parametrize("lift_per_newton", [0.6, 0.77, 0.95])
def test_the_ground_shows_in_the_lift_whatever_the_model_says(lift_per_newton: float) -> None:
    ground = flown(lift_per_newton)
    assert ground.carried == 0.0
    hover = GRAVITY / lift_per_newton
    for _ in range(100):  # 8 % less thrust would be the beginning of contact: not enough yet
        ground.observe(GRAVITY, hover / 1.08, SHARE, STEP)
    assert ground.carried == 0.0
    for k in range(100):
        ground.observe(GRAVITY, hover / 1.15, SHARE, STEP)
        assert ground.carried == pytest.approx((k + 1) * STEP)
    ground.observe(GRAVITY / 1.15, hover / 1.15, SHARE, STEP)  # it was a gust
    assert ground.carried == 0.0


def test_a_fall_a_climb_and_motors_at_rest_are_not_the_ground() -> None:
    ground = flown(0.77)
    hover = GRAVITY / 0.77
    for thrust in (0.3 * hover, 1.8 * hover, 0.0, float("nan")):
        for _ in range(500):
            lift = 0.77 * thrust if thrust > 0.0 else 0.0
            ground.observe(lift, thrust, SHARE, STEP)
        assert ground.carried == 0.0


def test_nothing_is_compared_before_a_second_of_flight() -> None:
    ground = flown(0.77, seconds=0.9)
    ground.observe(GRAVITY, 0.5 * GRAVITY / 0.77, SHARE, STEP)
    assert ground.carried == 0.0
