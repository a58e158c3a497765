"""Climb straight up from the ground."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from control.behaviors.arguments import TakeOffArguments
from control.behaviors.behavior import Context, TrajectoryBehavior, check_clear, check_inside
from control.behaviors.table import BehaviorName
from control.trajectories.line import Line
from quadrotor.parameters import Parameters


class TakeOff(TrajectoryBehavior):
    """Behavior that climbs vertically at constant speed between smooth ramps, keeping yaw."""

    name: ClassVar[BehaviorName] = BehaviorName.TAKE_OFF
    arguments: ClassVar[type[Parameters]] = TakeOffArguments

    @classmethod
    def defaults(cls, context: Context) -> Parameters:
        return TakeOffArguments(speed=context.parameters.take_off_speed)

    def __init__(self, context: Context, arguments: TakeOffArguments) -> None:
        x, y, z, yaw = context.point
        top = (x, y, z + arguments.height, yaw)
        check_inside(self.name, "the end at", np.array([top[:3]]), context.parameters)
        check_clear(self.name, (context.point[:3], top[:3]), context.parameters)
        acceleration = context.parameters.acceleration_max
        super().__init__(Line(context.point, top, speed=arguments.speed, acceleration=acceleration))
