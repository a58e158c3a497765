"""Fly to a point and turn to a yaw."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from control.behaviors.arguments import FlyToArguments
from control.behaviors.behavior import Context, Point, TrajectoryBehavior, check_clear, check_inside
from control.behaviors.table import BehaviorName
from control.trajectories.line import Line
from control.trajectories.polynomial import motion_of
from control.trajectories.retarget import Retarget
from control.trajectories.trajectory import Trajectory, sample_many
from quadrotor.parameters import Parameters


class FlyTo(TrajectoryBehavior):
    """Behavior that flies a straight line from rest, or from a moving reference a bend, to rest."""

    name: ClassVar[BehaviorName] = BehaviorName.FLY_TO
    arguments: ClassVar[type[Parameters]] = FlyToArguments

    @classmethod
    def defaults(cls, context: Context) -> Parameters:
        # Not validated: the present reference may be anywhere.
        x, y, z, yaw = context.point
        speed = context.parameters.fly_to_speed
        return FlyToArguments.model_construct(x=x, y=y, z=z, yaw=yaw, speed=speed)

    def __init__(self, context: Context, arguments: FlyToArguments) -> None:
        a = arguments
        end = np.array([[a.x, a.y, a.z]])
        check_inside(self.name, "the goal at", end, context.parameters)
        super().__init__(_path(context, (a.x, a.y, a.z, a.yaw), a.speed))


def _path(context: Context, end: Point, speed: float) -> Trajectory:
    p = context.parameters
    limits = {
        "speed": speed,
        "acceleration": p.acceleration_max,
        "yaw_rate": p.yaw_rate_max,
        "yaw_acceleration": p.yaw_acceleration_max,
    }
    if not motion_of(context.reference)[:, 1:].any():
        check_clear(BehaviorName.FLY_TO, (context.point[:3], end[:3]), p, may_leave=True)
        return Line(context.point, end, **limits)
    path = Retarget(context.reference, end, **limits)
    samples = sample_many(path, np.linspace(0.0, path.duration, 40))
    check_inside(
        BehaviorName.FLY_TO,
        "from this speed (brake first) the path's",
        samples["position_w"],
        p,
        start_w=context.point[:3],
    )
    check_clear(BehaviorName.FLY_TO, samples["position_w"], p, may_leave=True)
    return path
