"""A tracked body that is turned about the vertical is detected by tilting the vehicle by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from console.checks.body_turn import HELD, BodyTurn
from quadrotor.rotations import quaternion_from_matrix, rotation_exp

GRAVITY, STEP = 9.81, 0.01


def held(
    turn: BodyTurn, tilt: float, about: float, body: float, rate: float = 0.0, now: float = 0.0
) -> None:
    """Hold the vehicle for a second, tilted about a horizontal axis.

    Its tracked body is turned by `body`. Angles in degrees.
    """
    axis = np.array([math.cos(math.radians(about)), math.sin(math.radians(about)), 0.0])
    R_wb = rotation_exp(math.radians(30.0) * np.array([0.0, 0.0, 1.0])) @ rotation_exp(
        math.radians(tilt) * axis
    )
    R_wt = R_wb @ rotation_exp(math.radians(body) * np.array([0.0, 0.0, 1.0]))
    chance = np.random.default_rng(3)
    for k in range(100):
        force_b = R_wb.T @ np.array([0.0, 0.0, GRAVITY]) + chance.normal(0.0, 0.1, 3)
        turn.update(now + k * STEP, quaternion_from_matrix(R_wt), (rate, 0.0, 0.0), force_b)


@pytest.mark.parametrize("about", [0.0, 90.0, 200.0])
@pytest.mark.parametrize("body", [0.0, 90.0, -90.0, 180.0])
def test_the_turn_is_that_of_the_body(about: float, body: float) -> None:
    turn = BodyTurn()
    held(turn, 20.0, about, body)
    assert turn.angle is not None
    off = math.remainder(turn.angle - math.radians(body), math.tau)
    assert abs(math.degrees(off)) < 10.0


@pytest.mark.parametrize(("tilt", "rate"), [(0.0, 0.0), (5.0, 0.0), (20.0, 1.0)])
def test_at_rest_on_the_ground_and_in_motion_nothing_is_known(tilt: float, rate: float) -> None:
    turn = BodyTurn()
    held(turn, tilt, 40.0, 90.0, rate)
    assert turn.angle is None


def test_what_was_seen_holds_until_it_is_tilted_again() -> None:
    turn = BodyTurn()
    held(turn, 20.0, 0.0, 90.0)
    held(turn, 0.0, 0.0, 90.0, now=10.0)
    assert turn.angle == pytest.approx(math.radians(90.0), abs=0.2)
    held(turn, 20.0, 0.0, 0.0, now=20.0)
    assert turn.angle == pytest.approx(0.0, abs=0.2)


def test_a_short_tilt_says_nothing() -> None:
    turn = BodyTurn()
    leaning = (math.sin(math.radians(20.0)) * GRAVITY, 0.0, math.cos(math.radians(20.0)) * GRAVITY)
    R_wb = rotation_exp(math.radians(-20.0) * np.array([0.0, 1.0, 0.0]))
    quaternion = quaternion_from_matrix(R_wb)
    for k in range(round(HELD / STEP)):
        turn.update(k * STEP, quaternion, (0.0, 0.0, 0.0), leaning)
    assert turn.angle is None
