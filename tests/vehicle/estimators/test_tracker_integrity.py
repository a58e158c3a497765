"""A tracker with reversed, permuted or tilted axes contradicts the inertial sensors."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from benchmarks.flights.watched_flight import WatchedFlight
from quadrotor.errors import RefusedError
from quadrotor.plain_rotations import turned
from quadrotor.records import POSE_SAMPLE, Array
from vehicle.flight.modes import Flag

Lie = Callable[[Array, Array], tuple[Array, Array]]
"""Function from the true position and attitude to those that the tracker sends."""


def left_handed(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    """Return the pose in a frame whose y axis points to the right."""
    return position_w * (1, -1, 1), quaternion_wb * (1, -1, 1, -1)


def upside_down(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    """Return the pose in a frame whose z axis points down."""
    return position_w * (1, 1, -1), quaternion_wb * (1, -1, -1, 1)


def inverse(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    """Return the pose with the rotation from world to body."""
    return position_w, quaternion_wb * (1, -1, -1, -1)


def quarter_turn(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    """Return the pose of a body whose x axis points to the left."""
    return position_w, turned(quaternion_wb, (0.0, 0.0, 0.5 * math.pi))


def tilted(degrees: float) -> Lie:
    """Return a lie about the vertical."""
    turn = math.radians(degrees), 0.0, 0.0
    return lambda position_w, quaternion_wb: (position_w, turned(quaternion_wb, turn))


def lying(flight: WatchedFlight, lie: Lie | None) -> WatchedFlight:
    """Let the tracker of a flight lie from now on, or tell the truth again."""
    stack: Any = flight.stack
    measure = type(flight.stack).measure.__get__(stack)

    def wrong(message: Any) -> None:
        if lie is not None and isinstance(message, np.ndarray) and message.dtype == POSE_SAMPLE:
            message = message.copy()
            place, turn = lie(message["position_w"][0], message["quaternion_wb"][0])
            message["position_w"][0], message["quaternion_wb"][0] = place, turn
        measure(message)

    stack.measure = wrong
    return flight


def flags(flight: WatchedFlight) -> Flag:
    return Flag(int(flight.stack.status["flags"][0]))


def armed(lie: Lie, **settings: Any) -> WatchedFlight:
    flight = lying(WatchedFlight(1, {f"simulator.{k}": v for k, v in settings.items()}), lie)
    flight.wait_until(lambda v: v.mode == "ready", what="ready", timeout=20)
    flight.wait(2.0)
    flight.arm()
    flight.wait(0.5)
    return flight


def test_a_tracker_whose_z_axis_points_down_stops_the_motors_on_the_ground() -> None:
    flight = armed(upside_down)
    flight.start("take_off")
    flight.wait(2.0)
    assert flight.view().mode == "ready"
    assert any("position contradicts the accelerometer" in text for text in flight.events.texts)
    heights = flight.trace()[1][:, 2]
    assert heights.max() < 0.05
    with pytest.raises(RefusedError, match="contradicts the accelerometer"):
        flight.arm()
