"""The tracking error has a value where there is a reference in the air, and none on the ground."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.support.live_signals import Received, ticks_of
from web.live.spectra import recent, spectra

ERROR = "error.distance"
WEIGHT_HELD = -5.0
"""Reference acceleration, in m/s², while the vehicle takes thrust away to test the ground."""


def errors(
    climb: float,
    speed: tuple[float, float, float],
    acceleration: tuple[float, float, float],
    below: float = 0.05,
) -> list[float]:
    """Return the tracking errors of a vehicle that climbs so, of a reference that moves so."""
    received, ticks = Received(), ticks_of(5)
    ticks["state"]["velocity_w"][:, 2] = climb
    ticks["reference"]["position_w"][:, 2] = -below
    ticks["reference"]["velocity_w"], ticks["reference"]["acceleration_w"] = speed, acceleration
    received.ticks(ticks)
    return received.samples(ERROR)


@pytest.mark.parametrize("acceleration", [0.0, WEIGHT_HELD])
def test_a_reference_that_sinks_into_the_ground_is_no_error(acceleration: float) -> None:
    for climb in (0.0, -0.08, 0.03):
        assert np.isnan(errors(climb, (0.0, 0.0, -0.3), (0.0, 0.0, acceleration))).all()


@pytest.mark.parametrize(
    ("climb", "speed", "acceleration"),
    [
        (-0.28, (0.0, 0.0, -0.3), (0.0, 0.0, 0.0)),  # sinks as it should
        (0.0, (0.0, 0.0, -0.05), (0.0, 0.0, 0.0)),  # hovers, and is moved a little
        (0.0, (0.3, 0.0, -0.3), (0.0, 0.0, 0.0)),  # flies down a slope and lags
        (0.0, (0.0, 0.0, -0.3), (0.0, 1.0, 0.0)),  # and in a curve
        (0.0, (0.0, 0.0, -0.3), (0.0, 0.0, 1.0)),  # brakes
        (0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ],
)
def test_an_error_in_the_air_is_told(
    climb: float, speed: tuple[float, float, float], acceleration: tuple[float, float, float]
) -> None:
    assert errors(climb, speed, acceleration) == pytest.approx([50.0] * 5)


def test_a_descent_that_an_updraught_holds_up_is_an_error() -> None:
    assert errors(0.0, (0.0, 0.0, -0.3), (0.0, 0.0, 0.0), 0.31) == pytest.approx([310.0] * 5)


def test_a_reference_that_follows_the_vehicle_on_the_ground_gives_no_error() -> None:
    received = Received()
    received.ticks(ticks_of(5))
    for name in (ERROR, "error.yaw", "error.position.z"):
        assert np.isnan(received.samples(name)).all()


def test_a_spectrum_of_the_error_leaves_out_the_ground() -> None:
    ticks = ticks_of(2500)
    ticks["reference"]["position_w"][100:, 2] = 0.1 * np.sin(
        2.0 * math.pi * 20.0 * np.arange(2400) / 500.0
    )
    received = Received()
    received.ticks(ticks)
    [found] = spectra(recent(received.log, ["error.position.z"]))["spectra"]
    density = np.array(found["density"])
    assert np.isfinite(density).all()
    assert found["frequency"][int(density.argmax())] == pytest.approx(20.0, abs=1.0)
