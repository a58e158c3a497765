"""Climb straight up from the ground."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np

from control.behaviors.arguments import TakeOffArguments
from control.behaviors.behavior import Context, TrajectoryBehavior, check_inside, read_arguments
from control.behaviors.table import BehaviorName
from control.trajectories.line import Line
from quadrotor.parameters import Parameters, ParameterValue


class TakeOff(TrajectoryBehavior):
    """Behavior that climbs vertically at constant speed between smooth ramps, keeping yaw."""

    name: ClassVar[BehaviorName] = BehaviorName.TAKE_OFF
    arguments: ClassVar[type[Parameters]] = TakeOffArguments

    @classmethod
    def start(cls, context: Context, given: Mapping[str, ParameterValue]) -> Self:
        defaults = TakeOffArguments(speed=context.parameters.take_off_speed)
        return cls(context, read_arguments(cls.name, defaults, given))

    def __init__(self, context: Context, arguments: TakeOffArguments) -> None:
        x, y, z, yaw = context.point
        top = (x, y, z + arguments.height, yaw)
        check_inside(self.name, "the end at", np.array([top[:3]]), context.parameters)
        acceleration = context.parameters.acceleration_max
        super().__init__(Line(context.point, top, speed=arguments.speed, acceleration=acceleration))
