"""Fly a trajectory by name, from the place of hover, if the vehicle is able to."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar, Self

from control.behaviors.behavior import (
    Context,
    TrajectoryBehavior,
    argument_descriptions,
    read_arguments,
)
from control.behaviors.parameters import BehaviorParameters
from control.behaviors.table import BehaviorName
from control.behaviors.trajectory_arguments import FollowTrajectoryArguments, WhichTrajectory
from control.behaviors.trajectory_choice import CHOICES, Choice
from control.trajectories.feasibility import Feasibility, encounter, examine, fits, refusal
from control.trajectories.limits import WALLS, Limits, with_margin
from control.trajectories.trajectory import Trajectory
from quadrotor.errors import RefusedError, UnknownParameterError
from quadrotor.parameter_description import ParameterValue, coerce
from quadrotor.parameters import Parameters
from quadrotor.records import Record

_SLOWEST = 8.0
"""Largest factor by which a slower pace is proposed."""


class FollowTrajectory(TrajectoryBehavior):
    """Behavior that flies a trajectory from rest to rest, starting from the present reference.

    See `trajectory_choice.CHOICES`.
    """

    name: ClassVar[BehaviorName] = BehaviorName.FOLLOW_TRAJECTORY
    arguments: ClassVar[type[Parameters]] = FollowTrajectoryArguments

    @classmethod
    def start(cls, context: Context, given: Mapping[str, ParameterValue]) -> Self:
        return cls(context, *cls.chosen(context, given))

    @classmethod
    def chosen(
        cls, context: Context, given: Mapping[str, ParameterValue]
    ) -> tuple[Choice, WhichTrajectory]:
        """Return which trajectory these arguments choose, and all that it takes. Raises
        ParameterError.
        """
        form = argument_descriptions(FollowTrajectoryArguments)
        which = form["trajectory"]
        name = str(coerce(which, given.get("trajectory", which.default)))
        choice = CHOICES[name]
        taken = argument_descriptions(choice.arguments)
        for other in given:
            if other in form and other not in taken:
                raise UnknownParameterError(
                    f"follow_trajectory {name} takes no {other}: it takes {', '.join(taken)}"
                )
        # Not validated: the present reference may be anywhere.
        defaults = choice.arguments().model_copy(update=dict(choice.defaults(context)))
        return choice, read_arguments(cls.name, defaults, given)

    def __init__(self, context: Context, choice: Choice, arguments: WhichTrajectory) -> None:
        trajectory, self.report, refused = surveyed(context, choice, arguments)
        if refused:
            raise RefusedError(refused)
        super().__init__(trajectory)


def surveyed(
    context: Context, choice: Choice, arguments: WhichTrajectory
) -> tuple[Trajectory, Feasibility, str]:
    """Return the trajectory, its demands, and why the vehicle refuses it, "" when it does not.

    Raises ParameterError or RefusedError for arguments that make none.
    """
    limits = limits_of(context.parameters, context.model)
    trajectory = choice.make(context, arguments)
    report = examine(trajectory, context.model, limits)
    breach = report.breach
    if breach is None or breach.index >= WALLS:
        near = encounter(trajectory, context.parameters.boxes, context.parameters.keep_out_margin)
        if near:
            return trajectory, report, f"follow_trajectory refused: the path comes {near}"
    if breach is None:
        return trajectory, report, ""
    advice = _advice(context, choice, arguments, limits) if breach.index >= WALLS else ""
    return trajectory, report, refusal(report, breach, "follow_trajectory", advice)


def limits_of(p: BehaviorParameters, model: Record) -> Limits:
    """Return the limits of trajectories from the parameters and MODEL, shape (1,)."""
    low, high = with_margin(
        float(model["thrust_min"][0]), float(model["thrust_max"][0]), p.trajectory_thrust_margin
    )
    return Limits(
        low_w=p.low_w,
        high_w=p.high_w,
        speed=p.trajectory_speed_max,
        acceleration=p.trajectory_acceleration_max,
        yaw_rate=p.yaw_rate_max,
        yaw_acceleration=p.yaw_acceleration_max,
        tilt=math.radians(p.trajectory_tilt_max),
        thrust_low=low,
        thrust_high=high,
        body_rate=p.trajectory_body_rate_max,
        yaw_torque=p.trajectory_yaw_torque_max,
    )


def _advice(context: Context, choice: Choice, arguments: WhichTrajectory, limits: Limits) -> str:
    """Return the fastest feasible pace found, as advice on the arguments that set it."""
    taken = argument_descriptions(type(arguments))

    def changes(factor: float) -> dict[str, float] | None:
        """Return the arguments of a feasible pace, else None."""
        found = choice.slower(arguments, factor)
        for name, value in found.items():
            low, high = taken[name].minimum, taken[name].maximum
            if (low is not None and value < low) or (high is not None and value > high):
                return None
        slower = choice.make(context, arguments.model_copy(update=found))
        return found if fits(slower, context.model, limits) else None

    low, high = 1.0, 1.5
    best = changes(high)
    while best is None and high < _SLOWEST:
        low, high = high, 1.6 * high
        best = changes(high)
    if best is None:
        return "no slower pace helps; make it smaller"
    for _ in range(4):
        middle = math.sqrt(low * high)
        found = changes(middle)
        if found is None:
            low = middle
        else:
            best, high = found, middle
    words = []
    for name, value in best.items():
        unit = f" {taken[name].unit}" if taken[name].unit else ""
        words.append(f"{'an' if name[0] in 'aeiou' else 'a'} {name} of {value:g}{unit}")
    return f"try {' and '.join(words)}"
