"""Climb straight up from the ground."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from control.behaviors.arguments import TakeOffArguments
from control.behaviors.behavior import (
    Context,
    TickInputs,
    TrajectoryBehavior,
    check_clear,
    check_inside,
)
from control.behaviors.table import BehaviorName
from control.trajectories.lift_off_probe import BEGINS, add_probe
from control.trajectories.line import Line
from quadrotor.parameters import Parameters
from quadrotor.records import Record


class TakeOff(TrajectoryBehavior):
    """Behavior that climbs vertically at constant speed between smooth ramps, keeping yaw.

    Just above the ground it flies a circle of a millimetre or two, which tilts the vehicle by
    `behavior.take_off_probe`: see `lift_off_probe`.
    """

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
        self._probed_above, self._probed = z + BEGINS, 0.0
        self._tilt = math.radians(context.parameters.take_off_probe)

    def step(self, tick: TickInputs, reference: Record) -> bool:
        has_ended = super().step(tick, reference)
        if reference["position_w"][0, 2] > self._probed_above:
            self._probed += tick.dt
            add_probe(self._probed, self._tilt, reference)
        return has_ended
