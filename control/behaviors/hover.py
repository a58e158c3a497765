"""Hold the present reference."""

from __future__ import annotations

from typing import ClassVar

from control.behaviors.behavior import Context, NoArguments, TrajectoryBehavior
from control.behaviors.table import BehaviorName
from control.trajectories import line


class Hover(TrajectoryBehavior):
    """Behavior that holds the position in the air until something else is requested."""

    name: ClassVar[BehaviorName] = BehaviorName.HOVER

    def __init__(self, context: Context, arguments: NoArguments) -> None:
        x, y, z, yaw = context.point
        super().__init__(line.Hover((x, y, z), yaw))
