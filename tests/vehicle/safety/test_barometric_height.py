"""Height and climb rate from the barometer alone."""

from __future__ import annotations

import pytest

from quadrotor.vehicle_model import GRAVITY
from vehicle.safety.barometric_height import FARTHEST, PASCALS_PER_METRE, BarometricHeight


def settled() -> BarometricHeight:
    altitude = BarometricHeight()
    altitude.set_ground(96_000.0, 0.002)
    for _ in range(2000):
        altitude.step(96_000.0 - PASCALS_PER_METRE, GRAVITY, 0.002)
    return altitude


def test_it_follows_the_pressure() -> None:
    altitude = settled()
    assert altitude.height == pytest.approx(1.0, abs=0.1)
    assert abs(altitude.climb) < 0.2


@pytest.mark.parametrize("pressure", [60_000.0, 122_000.0])
def test_one_impossible_reading_moves_it_by_centimetres(pressure: float) -> None:
    altitude = settled()
    height, climb = altitude.height, altitude.climb
    altitude.step(pressure, GRAVITY, 0.002)
    assert abs(altitude.height - height) < 0.01 * FARTHEST
    assert abs(altitude.climb - climb) < 0.02
