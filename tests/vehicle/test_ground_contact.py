"""From take-off to the rest after touch-down."""

from __future__ import annotations

import pytest

from vehicle.ground_contact import TAKEN_OFF, GroundContact


def test_a_flight_from_the_ground_it_stood_on_to_rest() -> None:
    ground = GroundContact()
    ground.arm(0.4)
    ground.rise(0.4 + 0.9 * TAKEN_OFF)
    assert not ground.airborne
    ground.rise(0.4 + 1.1 * TAKEN_OFF)
    assert ground.airborne
    assert ground.rested(5) < 0.0
    assert ground.touch_down(2_000_000_000)
    assert not ground.airborne
    assert not ground.touch_down(2_500_000_000)  # told once
    assert ground.rested(3_000_000_000) == pytest.approx(1.0)


def test_disarming_forgets_the_landing() -> None:
    ground = GroundContact()
    ground.arm(0.0)
    ground.touch_down(1)
    ground.disarm()
    assert ground.rested(10**10) < 0.0
    assert ground.touch_down(2)
