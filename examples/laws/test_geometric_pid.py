"""The least that a law must do before it flies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vehicle.laws.contract import hovering, load

LAW = Path(__file__).with_name("geometric_pid.py")


def test_it_carries_the_weight_and_turns_nowhere_in_hover() -> None:
    thrust, torque = load(LAW).step(hovering(mass=1.2))
    assert thrust == pytest.approx(1.2 * 9.81)
    assert torque == pytest.approx(np.zeros(3))


def test_it_pushes_towards_the_reference() -> None:
    x = hovering()
    x.reference_position_w[:] = (0.1, 0.0, 1.2)  # forward and up
    thrust, torque = load(LAW).step(x)
    assert thrust > x.mass * 9.81
    assert torque[1] > 0.0  # nose down: about +y
    assert torque[0] == pytest.approx(0.0)
