"""Hold the present reference."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Self

from control.behaviors.behavior import Context, NoArguments, TrajectoryBehavior, read_arguments
from control.behaviors.table import BehaviorName
from control.trajectories import hover
from quadrotor.parameters import Parameters, ParameterValue


class Hover(TrajectoryBehavior):
    """Behavior that holds the position in the air until something else is requested."""

    name: ClassVar[BehaviorName] = BehaviorName.HOVER
    arguments: ClassVar[type[Parameters]] = NoArguments

    @classmethod
    def start(cls, context: Context, given: Mapping[str, ParameterValue]) -> Self:
        return cls(context, read_arguments(cls.name, NoArguments(), given))

    def __init__(self, context: Context, arguments: NoArguments) -> None:
        x, y, z, yaw = context.point
        super().__init__(hover.Hover((x, y, z), yaw))
