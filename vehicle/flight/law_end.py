"""The end of the control law: its wrench becomes a command at the level that the board accepts."""

from __future__ import annotations

import math
from collections.abc import Callable

from control.rate_law import rates_of_wrench
from vehicle.boards.board import BodyRates, Command, Takes
from vehicle.boards.reference_rounding import ReferenceRounding
from vehicle.flight.control_law import Steering
from vehicle.flight.tick_record import TickRecord

RATE_MAX = math.radians(300.0)
"""Fastest rotation, in rad/s, that is commanded about each axis."""


def law_end(level: Takes, tick: TickRecord, steering: Steering) -> Callable[[], Command]:
    """Return the function that makes the command of one tick from the tick's actuators."""
    if level is Takes.MOTORS:
        rounding = ReferenceRounding()
        return lambda: rounding.round(tick.motor_references)

    omega_b = tick.state["angular_velocity_b"][0]  # a view

    def rates() -> BodyRates:
        x, y, z, throttle = rates_of_wrench(
            tick.wrench, omega_b, steering.gains, steering.model, RATE_MAX
        )
        return BodyRates((x, y, z), throttle, tick.wrench.item(0))

    rates()  # compile now rather than in the first flight
    return rates
