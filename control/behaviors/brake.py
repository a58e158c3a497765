"""Come to a stop, from any motion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Self

from control.behaviors.behavior import Context, Joy, NoArguments, read_arguments
from control.behaviors.table import BehaviorName
from control.trajectories.velocity_filter import advance, new_velocity_filter
from quadrotor.parameters import Parameters, ParameterValue
from quadrotor.records import Record


class Brake:
    """The reference slows to rest; then hover."""

    name: ClassVar[BehaviorName] = BehaviorName.BRAKE
    progress = 0.0
    arguments: ClassVar[type[Parameters]] = NoArguments

    @classmethod
    def start(cls, context: Context, given: Mapping[str, ParameterValue]) -> Self:
        return cls(context, read_arguments(cls.name, NoArguments(), given))

    def __init__(self, context: Context, arguments: NoArguments) -> None:
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
