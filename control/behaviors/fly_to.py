"""Fly to a point and turn to a yaw."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np

from control.behaviors.behavior import Context, TrajectoryBehavior, check_inside, read_arguments
from control.behaviors.table import BehaviorName
from control.trajectories.line import Line
from control.trajectories.polynomial import motion_of, to_rest
from control.trajectories.trajectory import Trajectory, sample_many
from quadrotor.errors import RefusedError
from quadrotor.parameters import Parameters, ParameterValue, parameter


class FlyToArguments(Parameters):
    """Of fly_to; what is left out stays as it is."""

    x: float = parameter(0.0, unit="m", ge=-100.0, le=100.0, step=0.1, description="world x")
    y: float = parameter(0.0, unit="m", ge=-100.0, le=100.0, step=0.1, description="world y")
    z: float = parameter(1.0, unit="m", ge=-100.0, le=100.0, step=0.1, description="world z")
    yaw: float = parameter(
        0.0, unit="rad", ge=-6.3, le=6.3, step=0.05, description="yaw, turned the short way"
    )
    speed: float = parameter(
        0.8,
        unit="m/s",
        ge=0.05,
        le=5.0,
        step=0.05,
        description="largest speed; behavior.fly_to_speed if left out",
    )


class FlyTo(TrajectoryBehavior):
    """A straight line from rest; from a moving reference a polynomial that bends into rest."""

    name: ClassVar[BehaviorName] = BehaviorName.FLY_TO
    arguments: ClassVar[type[Parameters]] = FlyToArguments

    @classmethod
    def start(cls, context: Context, given: Mapping[str, ParameterValue]) -> Self:
        # Not validated: the present reference may be anywhere.
        x, y, z, yaw = context.point
        speed = context.parameters.fly_to_speed
        defaults = FlyToArguments.model_construct(x=x, y=y, z=z, yaw=yaw, speed=speed)
        return cls(context, read_arguments(cls.name, defaults, given))

    def __init__(self, context: Context, arguments: FlyToArguments) -> None:
        a = arguments
        end = np.array([[a.x, a.y, a.z]])
        check_inside(self.name, "the goal at", end, context.parameters)
        super().__init__(_path(context, (a.x, a.y, a.z, a.yaw), a.speed))


def _path(context: Context, end: tuple[float, float, float, float], speed: float) -> Trajectory:
    p = context.parameters
    limits = {
        "speed": speed,
        "acceleration": p.acceleration_max,
        "yaw_rate": p.yaw_rate_max,
        "yaw_acceleration": p.yaw_acceleration_max,
    }
    line = Line(context.point, end, **limits)
    motion = motion_of(context.reference)
    if not motion[:, 1:].any():
        return line
    # The shortest duration that respects the limits, or what the start itself exceeds them by.
    present = np.linalg.norm(motion[:3, 1:3], axis=0)
    fastest = 1.05 * max(speed, float(present[0]))
    hardest = 1.05 * max(1.5 * p.acceleration_max, float(present[1]))
    duration = max(line.duration, 1.5 * float(present[0]) / p.acceleration_max, 0.8)
    for _ in range(12):
        path = to_rest(context.reference, end, duration)
        samples = sample_many(path, np.linspace(0.0, duration, 40))
        velocity = np.linalg.norm(samples["velocity_w"], axis=1).max()
        acceleration = np.linalg.norm(samples["acceleration_w"], axis=1).max()
        if velocity <= fastest and acceleration <= hardest:
            check_inside(
                BehaviorName.FLY_TO,
                "from this speed the path's",
                samples["position_w"],
                p,
                start_w=context.point[:3],
            )
            return path
        duration *= 1.2
    raise RefusedError(
        f"fly_to refused: no path from {math.hypot(*motion[:3, 1]):.2f} m/s within "
        f"{fastest:.2f} m/s and {hardest:.2f} m/s²; request brake first"
    )
