"""Gains that are too high are told in flight, and taken back by choice; nominal flight is not."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.lab import Lab
from vehicle.modes import Flag

KP = "control.position.kp_xy"


def raise_gain(lab: Lab, value: float = 20.0) -> None:
    """Raise a gain as a slider does: in steps."""
    for step in np.arange(8.0, value + 0.1, 4.0):
        lab.change({KP: float(step)})
        lab.wait(0.1)


def fly_until_found(lab: Lab) -> float:
    """Return how long after the first error of 30 mm the flag came, s."""
    reached = None
    for _ in range(8000):
        lab.advance()
        tick = lab.stack.record
        error = np.linalg.norm(tick["state"]["position_w"] - tick["reference"]["position_w"])
        if reached is None and error > 0.03:
            reached = lab.stack.stamp_ns
        if Flag.OSCILLATING in lab.flags:
            return 1e-9 * (lab.stack.stamp_ns - (reached or lab.stack.stamp_ns))
    raise AssertionError("the oscillation was not found")


def test_a_gain_too_high_is_told_while_it_grows_and_over_once_it_is_taken_back() -> None:
    lab = Lab().hovering(settling=3.0)
    assert not lab.flags & (Flag.OSCILLATING | Flag.OFF_REFERENCE)
    raise_gain(lab)
    assert fly_until_found(lab) <= 1.5
    status = lab.stack.status
    assert status["oscillation_axis"][0] in (0, 1)
    assert status["oscillation_frequency"][0] == pytest.approx(0.75, abs=0.15)
    assert "oscillating in" in lab.said
    assert lab.stack.store.get(KP) == 20.0  # warning is the default
    for value in (16.0, 12.0, 8.0, 4.0):
        lab.change({KP: value})
        lab.wait(0.1)
    lab.wait(8.0)
    assert Flag.OSCILLATING not in lab.flags
    assert status["oscillation_frequency"][0] == 0.0


def test_by_choice_the_value_before_the_last_act_is_restored_in_steps() -> None:
    lab = Lab(settings={"safety.oscillation_reaction": "restore"}).hovering(settling=3.0)
    raise_gain(lab)
    fly_until_found(lab)
    lab.wait(0.5)
    assert lab.stack.store.get(KP) == 4.0
    assert f"restoring {KP} = 4.0" in lab.said
    steps = [c.new for c in lab.kept.changes if c.name == KP and c.requester == "vehicle"]
    assert steps == [16.0, 12.0, 8.0, 4.0]


def test_by_choice_the_vehicle_brakes() -> None:
    lab = Lab(settings={"safety.oscillation_reaction": "brake"}).hovering(settling=3.0)
    raise_gain(lab)
    fly_until_found(lab)
    lab.wait(0.1)
    assert lab.view().behavior in ("brake", "hover")
    assert "braking: oscillating in" in lab.said
