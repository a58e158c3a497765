"""The trajectories that follow_trajectory offers by name: their arguments and how they are made."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from control.behaviors.behavior import Context
from control.behaviors.trajectory_arguments import (
    CircleArguments,
    FigureEightArguments,
    FigureEightLapArguments,
    FileArguments,
    HelixArguments,
    LapArguments,
    LineArguments,
    WaypointArguments,
    WhichTrajectory,
)
from control.behaviors.way_points import read_waypoints
from control.trajectories.circle import Circle
from control.trajectories.figure_eight import FigureEight
from control.trajectories.line import Line
from control.trajectories.minimum_snap import within
from control.trajectories.trajectory import Trajectory
from quadrotor.errors import OutOfBoundsError, RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.rotations import wrap_angle

NEAR = 2e-3
"""Largest distance, in m and rad, of a file's start from here; the path is shifted by it."""

Changes = dict[str, float]


@dataclass(frozen=True, slots=True)
class Choice:
    """One trajectory of follow_trajectory."""

    arguments: type[WhichTrajectory]
    make: Callable[[Context, Any], Trajectory]
    """Create the trajectory; raises ParameterError or RefusedError for invalid arguments."""
    slower: Callable[[Any, float], Changes]
    """Return the arguments that change when the same path takes `factor` times the time."""
    defaults: Callable[[Context], Mapping[str, ParameterValue]] = lambda _: {}


def _period(a: Any, factor: float) -> Changes:
    return {"period": math.ceil(10.0 * a.period * factor - 1e-9) / 10.0}


def _pace(a: Any, factor: float) -> Changes:
    return {
        "speed": math.floor(100.0 * a.speed / factor) / 100.0,
        "acceleration": math.floor(100.0 * a.acceleration / factor**2) / 100.0,
    }


def _time_factor(a: FileArguments, factor: float) -> Changes:
    return {"time_factor": math.ceil(20.0 * a.time_factor * factor - 1e-9) / 20.0}


def _check_ramp(a: LapArguments) -> None:
    if a.ramp > a.laps * a.period:
        raise OutOfBoundsError(
            f"ramp = {a.ramp:g} s does not fit into {a.laps} laps of {a.period:g} s; "
            f"allowed up to {a.laps * a.period:g} s"
        )


def _shape(a: WhichTrajectory) -> dict[str, Any]:
    """Return the arguments under the names of the trajectory's own class."""
    return a.model_dump(exclude={"trajectory"})


def _figure_eight(context: Context, a: FigureEightArguments) -> Trajectory:
    _check_ramp(a)
    x, y, z, yaw = context.point
    return FigureEight((x, y, z), yaw, **_shape(a))


def _figure_eight_lap(context: Context, a: FigureEightLapArguments) -> Trajectory:
    x, y, z, yaw = context.point
    shape = _shape(a)
    return FigureEight.in_one_lap((x, y, z), yaw, duration=shape.pop("period"), **shape)


def _circle(context: Context, a: CircleArguments) -> Trajectory:
    _check_ramp(a)
    return Circle(context.point, **_shape(a))


def _line(context: Context, a: LineArguments) -> Trajectory:
    p = context.parameters
    return Line(
        context.point,
        (a.x, a.y, a.z, a.yaw),
        speed=a.speed,
        acceleration=a.acceleration,
        jerk=a.jerk,
        yaw_rate=p.yaw_rate_max,
        yaw_acceleration=p.yaw_acceleration_max,
    )


def _waypoints(context: Context, a: WaypointArguments) -> Trajectory:
    p = context.parameters
    return within(
        read_waypoints(a.waypoints, context.point),
        speed=a.speed,
        acceleration=a.acceleration,
        yaw_rate=p.yaw_rate_max,
        yaw_acceleration=p.yaw_acceleration_max,
    )


def _file(context: Context, a: FileArguments) -> Trajectory:
    path = context.trajectories.get(a.file)
    if path is None:
        there = ", ".join(context.trajectories) or "none: the trajectory folder has none"
        raise OutOfBoundsError(f"file = {a.file!r} is not loaded; there are {there}")
    here = context.point
    if a.anchor == "world":
        x, y, z, yaw = path.coefficients[0, :, 0].tolist()
        away = max(math.dist((x, y, z), here[:3]), abs(wrap_angle(yaw - here[3])))
        if away > NEAR:
            raise RefusedError(
                f"follow_trajectory refused: {a.file} starts at x = {x:.3f}, y = {y:.3f}, "
                f"z = {z:.3f} m, yaw = {wrap_angle(yaw):.3f} rad, which is not here; fly_to there "
                "first, or give anchor = here"
            )
    return path.moved(here).slowed(a.time_factor)


def _here(context: Context) -> Mapping[str, ParameterValue]:
    x, y, z, yaw = context.point
    return {"x": x, "y": y, "z": z, "yaw": yaw, **_bounds(context)}


def _bounds(context: Context) -> Mapping[str, ParameterValue]:
    p = context.parameters
    return {"speed": p.fly_to_speed, "acceleration": p.acceleration_max}


CHOICES: dict[str, Choice] = {
    "figure_eight": Choice(FigureEightArguments, _figure_eight, _period),
    "figure_eight_lap": Choice(FigureEightLapArguments, _figure_eight_lap, _period),
    "circle": Choice(CircleArguments, _circle, _period),
    "helix": Choice(HelixArguments, _circle, _period),
    "line": Choice(LineArguments, _line, _pace, _here),
    "waypoints": Choice(WaypointArguments, _waypoints, _pace, _bounds),
    "file": Choice(FileArguments, _file, _time_factor),
}
"""Choices in the order of trajectory_arguments.TRAJECTORIES."""
