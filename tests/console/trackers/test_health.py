"""Poses that must not be flown on are reported; others are passed on."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import numpy as np
import pytest

from console.trackers.health import BodyHealth, to_world
from console.trackers.source import Body
from quadrotor.plain_rotations import Array, quaternion_of, turned

PERIOD = 0.01
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def body(place: Array, turn: Array | None = LEVEL, name: str = "cf7") -> Body:
    return Body(name, np.asarray(place, np.float64), turn)


def circle(t: float) -> Body:
    """Return a pose on a circle of 1 m around (0.5, 0, 1.2).

    The body moves at 3 m/s, tilted as a quadrotor is, and turns at 2 rad/s.
    """
    place = np.array([0.5 + math.cos(3 * t), math.sin(3 * t), 1.2])
    yawed = np.array(quaternion_of(0.0, 0.0, 2 * t))
    return body(place, turned(yawed, (0.4, 0.3, 0.0)))


def fly(
    health: BodyHealth,
    frames: int,
    wrong: Callable[[Body], Body] = lambda one: one,
    begin: int = 0,
    others: dict[str, Array] | None = None,
) -> list[bool]:
    return [
        health.judge(wrong(circle(k * PERIOD)), k * PERIOD, others or {})
        for k in range(begin, begin + frames)
    ]


def test_a_fast_flight_is_passed_on_whole() -> None:
    health = BodyHealth()
    assert all(fly(health, 1000))
    assert (health.jumps, health.problem(9.99)) == (0, "")


@pytest.mark.parametrize("frozen", [0.3, 1.0, 1.9, 10.0])
def test_a_body_that_was_frozen_is_passed_on_when_it_moves_again(frozen: float) -> None:
    """The place to which it has moved meanwhile may look mirrored, and its axes flipped."""
    health, frames = BodyHealth(), round(frozen / PERIOD)
    assert all(fly(health, 100))
    still = circle(0.99)
    assert all(health.judge(still, k * PERIOD, {}) for k in range(100, 100 + frames))
    assert all(fly(health, 100, begin=100 + frames))
    assert health.problem((199 + frames) * PERIOD) == ""


def times(turn: tuple[float, float, float]) -> Callable[[Body], Body]:
    """Return a function that turns the body's axes, like a changed definition of the body."""

    def wrong(one: Body) -> Body:
        assert one.quaternion_wb is not None
        return one._replace(quaternion_wb=turned(one.quaternion_wb, turn))

    return wrong


def placed(matrix: list[list[float]]) -> Callable[[Body], Body]:
    return lambda one: one._replace(position_w=np.array(matrix) @ one.position_w)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (times((0, 0, math.pi / 2)), "axes have flipped by 90°"),
        (times((0, math.pi, 0)), "axes have flipped by 180°"),
        (placed([[-1, 0, 0], [0, 1, 0], [0, 0, 1]]), "mirrored along x"),
        (placed([[0, -1, 0], [1, 0, 0], [0, 0, 1]]), "turned by 90° about z"),
        (placed([[1, 0, 0], [0, 0, 1], [0, -1, 0]]), "y-up"),
        (placed([[1000, 0, 0], [0, 1000, 0], [0, 0, 1000]]), "--unit mm"),
    ],
)
def test_axes_that_change_in_flight_are_named_and_withheld_until_they_are_right_again(
    wrong: Callable[[Body], Body], told: str
) -> None:
    health = BodyHealth()
    fly(health, 30)
    assert not any(fly(health, 50, wrong, begin=30))
    assert told in health.problem(0.79)
    assert all(fly(health, 50, begin=80))
    assert health.withheld == ""


def test_bodies_that_the_system_takes_for_each_other_are_withheld() -> None:
    other = np.array([-1.0, -2.0, 1.0])
    health = BodyHealth()
    fly(health, 30, others={"cf8": other})
    assert not any(fly(health, 20, lambda one: body(other), 30, {"cf8": other}))
    assert "cf7 and cf8 have changed places" in health.withheld


def test_a_jump_without_an_explanation_is_told_and_passed_on() -> None:
    health = BodyHealth()
    fly(health, 30)
    assert all(fly(health, 1, lambda one: body(one.position_w + 0.4), 30))
    assert "jumped by" in health.problem(0.3)
    assert health.problem(2.0) == ""


@pytest.mark.parametrize(
    ("one", "told"),
    [
        (body(np.array([512.0, 33.0, 87.0])), "520 m from the origin.*--unit mm"),
        (body(np.array([0.5, 0.1, -1.5])), "1.5 m below the floor.*--up y"),
        (body(np.array([0.0, math.nan, 0.0])), "not finite"),
        (body(np.zeros(3), np.array([0.0, 0.0, 0.0, 0.5])), "unit length.*order"),
    ],
)
def test_a_pose_that_cannot_be_is_withheld_from_the_first(one: Body, told: str) -> None:
    health = BodyHealth()
    assert not health.judge(one, 0.0, {})
    assert re.search(told, health.problem(0.0))


def test_a_body_that_lies_on_its_side_is_told_with_the_axis() -> None:
    health = BodyHealth()
    y_up = np.array(quaternion_of(-math.pi / 2, 0.0, 0.0))
    taken = [health.judge(body(np.zeros(3), y_up), k * PERIOD, {}) for k in range(100)]
    assert taken[0]
    assert not taken[-1]
    assert "along the world's +y" in health.problem(0.99)
    assert "--up y" in health.problem(0.99)


def test_millimetres_and_y_up_are_turned_into_the_world_where_they_are_named() -> None:
    """The body is at (1, 2, 3), yawed to the left by 0.3 rad, in a system that is y-up."""
    seen = body(np.array([1000.0, 3000.0, -2000.0]), np.array(quaternion_of(0.0, 0.3, 0.0)))
    found = to_world(seen, "mm", "y")
    np.testing.assert_allclose(found.position_w, (1.0, 2.0, 3.0))
    assert found.quaternion_wb is not None
    np.testing.assert_allclose(found.quaternion_wb, quaternion_of(0.0, 0.0, 0.3))


def test_what_a_body_did_long_ago_says_nothing_about_it() -> None:
    health = BodyHealth()
    fly(health, 30)
    assert not any(fly(health, 10, times((0, 0, math.pi)), 30))
    assert all(fly(health, 10, times((0, 0, math.pi)), 500))
