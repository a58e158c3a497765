"""Fly a trajectory by name, about where the vehicle hovers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np

from control.behaviors.behavior import Context, TrajectoryBehavior, check_inside, read_arguments
from control.behaviors.table import BehaviorName
from control.trajectories.figure_eight import FigureEight
from control.trajectories.trajectory import sample_many
from quadrotor.errors import OutOfBoundsError, RefusedError
from quadrotor.parameters import Parameters, ParameterValue, parameter

TRAJECTORIES = ("figure_eight",)


class FollowTrajectoryArguments(Parameters):
    """Of follow_trajectory; the defaults are the 8 of the paper's second experiment."""

    trajectory: str = parameter("figure_eight", choices=TRAJECTORIES, description="which one")
    laps: int = parameter(3, ge=1, le=1000, step=1, description="whole laps")
    period: float = parameter(
        8.0, unit="s", ge=2.0, le=60.0, step=0.5, description="time of one lap"
    )
    width: float = parameter(1.0, unit="m", ge=0.0, le=20.0, step=0.1, description="size in x")
    height: float = parameter(1.0, unit="m", ge=0.0, le=20.0, step=0.1, description="size in y")
    z_amplitude: float = parameter(
        0.2, unit="m", ge=0.0, le=5.0, step=0.05, description="up and down by this"
    )
    yaw_amplitude: float = parameter(
        1.0, unit="rad", ge=0.0, le=3.1, step=0.1, description="yaw to both sides by this"
    )
    ramp: float = parameter(
        3.0, unit="s", ge=0.5, le=30.0, step=0.5, description="time to the full rate and back"
    )


class FollowTrajectory(TrajectoryBehavior):
    """From rest to rest; centre and middle yaw are the present reference."""

    name: ClassVar[BehaviorName] = BehaviorName.FOLLOW_TRAJECTORY
    arguments: ClassVar[type[Parameters]] = FollowTrajectoryArguments

    @classmethod
    def start(cls, context: Context, given: Mapping[str, ParameterValue]) -> Self:
        return cls(context, read_arguments(cls.name, FollowTrajectoryArguments(), given))

    def __init__(self, context: Context, arguments: FollowTrajectoryArguments) -> None:
        a = arguments
        if a.ramp > a.laps * a.period:
            raise OutOfBoundsError(
                f"ramp = {a.ramp:g} s does not fit into {a.laps} laps of {a.period:g} s; "
                f"allowed up to {a.laps * a.period:g} s"
            )
        x, y, z, yaw = context.point
        eight = FigureEight(
            (x, y, z),
            yaw,
            width=a.width,
            height=a.height,
            z_amplitude=a.z_amplitude,
            yaw_amplitude=a.yaw_amplitude,
            period=a.period,
            laps=a.laps,
            ramp=a.ramp,
        )
        _check(eight, a, context)
        super().__init__(eight)


def _check(eight: FigureEight, a: FollowTrajectoryArguments, context: Context) -> None:
    """Raises RefusedError for what the volume or the vehicle cannot take."""
    p = context.parameters
    # The ramp and one lap hold every extreme: later laps repeat, the end mirrors the start.
    last = min(eight.duration, a.ramp + a.period)
    samples = sample_many(eight, np.linspace(0.0, last, 160))
    check_inside(
        BehaviorName.FOLLOW_TRAJECTORY,
        "the path's",
        samples["position_w"],
        p,
    )
    acceleration = float(np.linalg.norm(samples["acceleration_w"], axis=1).max())
    yaw_rate = float(np.abs(samples["yaw_rate"]).max())
    yaw_acceleration = float(np.abs(samples["yaw_acceleration"]).max())
    for what, value, limit, unit, name in (
        (
            "acceleration",
            acceleration,
            p.trajectory_acceleration_max,
            "m/s²",
            "trajectory_acceleration_max",
        ),
        ("yaw rate", yaw_rate, p.yaw_rate_max, "rad/s", "yaw_rate_max"),
        (
            "yaw acceleration",
            yaw_acceleration,
            p.yaw_acceleration_max,
            "rad/s²",
            "yaw_acceleration_max",
        ),
    ):
        if value > limit:
            slower = math.ceil(10.0 * a.period * (value / limit)) / 10.0
            raise RefusedError(
                f"follow_trajectory refused: its {what} reaches {value:.2f} {unit}; allowed up "
                f"to {limit:g} {unit} (behavior.{name}); try a period of {slower:g} s"
            )
