"""The least that a behavior must do before it flies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vehicle.behaviors.contract import Answer, hovering, load

BEHAVIOR = Path(__file__).with_name("sway.py")
LONGEST = 60.0  # s
DT = 0.002  # s


def flown() -> list[Answer]:
    """Return its references from hover at 1 m until it ends."""
    behavior, x = load(BEHAVIOR), hovering(height=1.0)
    behavior.reset(x)
    answers: list[Answer] = []
    while (answer := behavior.step(x)) is not None:
        answers.append(Answer(*answer))
        x.time, x.reset, x.reference_position_w[:] = x.time + DT, 0.0, answers[-1].position_w
        assert x.time < LONGEST
    return answers


def test_it_begins_where_the_vehicle_is_and_never_jumps() -> None:
    path = np.array([[0.0, 0.0, 1.0], *(answer.position_w for answer in flown())])
    assert np.abs(np.diff(path, axis=0)).max() < 2.0 * DT  # 2 m/s


def test_its_velocity_is_the_derivative_of_its_position() -> None:
    answers = flown()
    path = np.array([answer.position_w for answer in answers])
    velocity = np.array([answer.velocity_w for answer in answers])
    assert np.gradient(path, DT, axis=0)[1:-1] == pytest.approx(velocity[1:-1], abs=1e-3)
