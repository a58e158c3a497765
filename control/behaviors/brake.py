"""Brake to a stop from any motion."""

from __future__ import annotations

from typing import ClassVar

from control.behaviors.behavior import Context, Joy, WithoutArguments
from control.behaviors.table import BehaviorName
from control.trajectories.velocity_filter import advance, new_velocity_filter
from quadrotor.records import Record


class Brake(WithoutArguments):
    """Behavior that slows the reference down to rest, after which the vehicle hovers."""

    name: ClassVar[BehaviorName] = BehaviorName.BRAKE

    def __init__(self, context: Context) -> None:
        p = context.parameters
        self._filter = new_velocity_filter(
            context.reference, p.brake_deceleration, p.yaw_acceleration_max
        )

    def step(
        self,
        stamp_ns: int,
        dt: float,
        state: Record,
        joy: Joy | None,
        thrust: float,
        reference: Record,
    ) -> bool:
        return bool(advance(self._filter, dt, reference))
