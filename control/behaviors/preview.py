"""The preview of a trajectory of follow_trajectory: its path, its demands, and the reason of a
refusal. The function imports heavy modules itself, because it runs in a helper process.
"""

from __future__ import annotations

import json
import os
import select
from collections.abc import Callable, Mapping
from dataclasses import asdict

from control.behaviors.demands import Preview
from quadrotor.errors import QuadlabError
from quadrotor.parameter_description import ParameterValue

POINTS = 400
IDLE = 30.0  # s without an order, after which the helper process ends


def preview(
    point: tuple[float, float, float, float],
    arguments: Mapping[str, ParameterValue],
    parameters: Mapping[str, ParameterValue],
    voltage: float | None = None,
) -> Preview:
    """Return the preview of follow_trajectory with these arguments from x, y, z (m), yaw (rad).

    Args:
        parameters: the vehicle's, by full name; `behavior.` and `model.` count.
        voltage: V, of the battery; None is the nominal one.

    Raises ParameterError or RefusedError for arguments that make no trajectory.
    """
    import numpy as np

    from control.behaviors.behavior import Context
    from control.behaviors.follow_trajectory import FollowTrajectory, surveyed
    from control.behaviors.parameters import BehaviorParameters
    from control.trajectories.trajectory import sample_many
    from quadrotor.parameters import section_of
    from quadrotor.records import new_reference
    from quadrotor.vehicle_model import GRAVITY, VehicleModel

    behavior = section_of(BehaviorParameters, "behavior.", parameters)
    model = section_of(VehicleModel, "model.", parameters)
    reference = new_reference()
    reference["position_w"][0], reference["yaw"] = point[:3], point[3]
    context = Context(reference, behavior, model.mass * GRAVITY, model.record(voltage))
    trajectory, report, refusal = surveyed(context, *FollowTrajectory.chosen(context, arguments))
    path = sample_many(trajectory, np.linspace(0.0, trajectory.duration, POINTS))["position_w"]
    speed = report.of("speed").value
    return Preview([(x, y, z) for x, y, z in path.tolist()], trajectory.duration, speed, refusal)


def previews(orders: int, report: Callable[[object], None]) -> None:
    """Report {"preview": …} or {"error": [class, text]} for each line of JSON with the arguments of
    `preview` that arrives on this file descriptor, until it is closed or silent for IDLE.
    """
    with os.fdopen(orders, "rb", buffering=0) as lines:
        while select.select([lines], [], [], IDLE)[0] and (line := lines.readline()):
            try:
                report({"preview": asdict(preview(*json.loads(line)))})
            except QuadlabError as error:
                report({"error": [type(error).__name__, str(error)]})
