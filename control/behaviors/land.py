"""Descend at a constant speed until touch-down."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from control.behaviors.arguments import LandArguments
from control.behaviors.behavior import Behavior, Context, TickInputs
from control.behaviors.table import BehaviorName
from control.trajectories.velocity_filter import advance, new_velocity_filter
from quadrotor.compiled import compiled
from quadrotor.parameters import Parameters
from quadrotor.records import Record

TOUCH_DOWN = np.dtype(
    [
        ("thrust_max", "f8"),  # N: above, the vehicle still flies
        ("velocity_change_max", "f8"),  # m/s
        ("dwell", "f8"),  # s
        ("velocity_w", "f8", 3),  # m/s, when the thrust was last high or the velocity changed
        ("time", "f8"),  # s since then
    ],
    align=True,
)


@compiled
def touched_down(detector: Record, dt: float, thrust: float, state: Record) -> bool:
    """Return whether the vehicle is on the ground.

    There, thrust is low for a while, and yet the velocity does not change. In the air, thrust at
    0.6 of the weight changes the velocity by 0.2 m/s in 50 ms. The change counts, not the velocity
    itself: a dead-reckoned estimate drifts, but slowly.

    Args:
        detector, state: TOUCH_DOWN and STATE, shape (1,).
        thrust: N, commanded.
    """
    d = detector[0]
    s = state[0]
    d.time += dt
    change = 0.0
    for i in range(3):
        difference = s.velocity_w[i] - d.velocity_w[i]
        change += difference * difference
    # Written so that a NaN counts as a change.
    if thrust > d.thrust_max or not math.sqrt(change) <= d.velocity_change_max:
        d.time = 0.0
        for i in range(3):
            d.velocity_w[i] = s.velocity_w[i]
    return bool(d.time >= d.dwell)


class Land(Behavior):
    """Behavior whose reference stops sideways and descends without end, also below the ground.

    On the ground the growing error reduces the thrust to its minimum of 0.3 m g
    (position_law.LIFT_MIN), from which touch-down is detected.
    """

    name: ClassVar[BehaviorName] = BehaviorName.LAND
    arguments: ClassVar[type[Parameters]] = LandArguments

    @classmethod
    def defaults(cls, context: Context) -> Parameters:
        return LandArguments(speed=context.parameters.landing_speed)

    def __init__(self, context: Context, arguments: LandArguments) -> None:
        p = context.parameters
        self._filter = new_velocity_filter(
            context.reference, p.acceleration_max, p.yaw_acceleration_max
        )
        self._filter["command"][0, 2] = -arguments.speed
        self._detector = np.zeros(1, TOUCH_DOWN)
        self._detector["thrust_max"] = p.landing_thrust_share * context.hover_thrust
        self._detector["velocity_change_max"] = p.landing_velocity_change
        self._detector["dwell"] = p.landing_dwell

    def step(self, tick: TickInputs, reference: Record) -> bool:
        advance(self._filter, tick.dt, reference)
        return bool(touched_down(self._detector, tick.dt, tick.thrust, tick.state))
