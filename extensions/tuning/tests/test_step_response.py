"""Figures of a step against the known second-order response."""

from __future__ import annotations

import math

import numpy as np
import pytest

from extensions.tuning.step_response import BAND, step_response

RATE = 500.0


def second_order(zeta: float, omega: float, time: np.ndarray) -> np.ndarray:
    """Return the unit step response of omega^2 / (s^2 + 2 zeta omega s + omega^2)."""
    if zeta == 1.0:
        return 1.0 - (1.0 + omega * time) * np.exp(-omega * time)
    if zeta > 1.0:
        root = math.sqrt(zeta**2 - 1.0)
        a, b = omega * (zeta - root), omega * (zeta + root)
        return 1.0 - (b * np.exp(-a * time) - a * np.exp(-b * time)) / (b - a)
    damped = omega * math.sqrt(1.0 - zeta**2)
    wave = np.cos(damped * time) + zeta / math.sqrt(1.0 - zeta**2) * np.sin(damped * time)
    return 1.0 - np.exp(-zeta * omega * time) * wave


def exactly(zeta: float, omega: float, level: float) -> float:
    """Return when the response is first at this level, by bisection on a fine grid."""
    time = np.linspace(0.0, 20.0 / omega, 400_001)
    return float(time[np.argmax(second_order(zeta, omega, time) >= level)])


def settled(zeta: float, omega: float) -> float:
    time = np.linspace(0.0, 40.0 / omega, 400_001)
    off = np.abs(second_order(zeta, omega, time) - 1.0)
    return float(time[np.flatnonzero(off > BAND)[-1]])


CASES = [(0.2, 6.0), (0.4, 4.0), (0.6, 3.0), (0.707, 5.0), (0.9, 8.0), (1.0, 4.0), (1.6, 6.0)]


@pytest.mark.parametrize(("zeta", "omega"), CASES)
@pytest.mark.parametrize("swing", [0.3, -0.6])
def test_figures_are_those_of_the_second_order_response(
    zeta: float, omega: float, swing: float
) -> None:
    time = np.arange(0.0, 40.0 / omega, 1.0 / RATE)
    actual = 1.2 + swing * second_order(zeta, omega, time)
    found = step_response(time, actual, 1.2, 1.2 + swing)
    overshoot = 0.0
    if zeta < 1.0:
        overshoot = 100.0 * math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2))
    # The peak is between samples: off by at most 1/2 (omega h)^2 of it, 0.03 % here.
    assert found.overshoot == pytest.approx(overshoot, abs=0.05)
    assert found.delay == pytest.approx(exactly(zeta, omega, 0.5), abs=2e-4)
    rise = exactly(zeta, omega, 0.9) - exactly(zeta, omega, 0.1)
    assert found.rise == pytest.approx(rise, abs=4e-4)
    assert found.settling == pytest.approx(settled(zeta, omega), abs=3e-3)
    assert abs(found.steady_error) < 2e-3 * abs(swing)


def test_textbook_estimates_hold() -> None:
    """t_s of 5 % is about 3 / (zeta omega), the rise of a well damped one about 1.8 / omega."""
    time = np.arange(0.0, 6.0, 1.0 / RATE)
    found = step_response(time, second_order(0.5, 4.0, time), 0.0, 1.0)
    assert found.settling == pytest.approx(3.0 / (0.5 * 4.0), rel=0.15)
    assert found.rise == pytest.approx(1.8 / 4.0, rel=0.15)


def test_a_first_order_lag_has_its_known_figures() -> None:
    time, lag = np.arange(0.0, 4.0, 1.0 / RATE), 0.3
    found = step_response(time, 1.0 - np.exp(-time / lag), 0.0, 1.0)
    assert found.delay == pytest.approx(lag * math.log(2.0), abs=1e-4)
    assert found.rise == pytest.approx(lag * math.log(9.0), abs=2e-4)
    assert found.settling == pytest.approx(lag * math.log(20.0), abs=2e-4)
    assert found.overshoot == 0.0


def test_a_pure_delay_moves_the_response_and_nothing_else() -> None:
    time = np.arange(0.0, 6.0, 1.0 / RATE)
    plain = step_response(time, second_order(0.5, 5.0, time), 0.0, 1.0)
    late = np.where(time < 0.1, 0.0, second_order(0.5, 5.0, time - 0.1))
    found = step_response(time, late, 0.0, 1.0)
    assert plain.delay is not None
    assert plain.settling is not None
    assert found.delay == pytest.approx(plain.delay + 0.1, abs=1e-6)
    assert found.rise == pytest.approx(plain.rise, abs=1e-6)
    assert found.settling == pytest.approx(plain.settling + 0.1, abs=1e-6)
    assert found.overshoot == pytest.approx(plain.overshoot, abs=1e-9)


def test_what_is_not_reached_has_no_figure() -> None:
    time = np.arange(0.0, 2.0, 1.0 / RATE)
    found = step_response(time, 0.7 * (1.0 - np.exp(-time / 0.2)), 0.0, 1.0)
    assert found.delay is not None
    assert (found.rise, found.settling, found.overshoot) == (None, None, 0.0)
    assert found.steady_error == pytest.approx(0.3, abs=1e-3)
    ringing = 1.0 + 0.2 * np.sin(20.0 * time)
    assert step_response(time, ringing, 0.0, 1.0).settling is None
    assert step_response(time, 0.0 * time, 0.0, 1.0).delay is None


def test_the_rms_error_is_that_of_the_whole_stretch() -> None:
    time = np.arange(0.0, 1.0, 1.0 / RATE)
    assert step_response(time, 0.0 * time + 0.4, 0.0, 1.0).rms_error == pytest.approx(0.6)
