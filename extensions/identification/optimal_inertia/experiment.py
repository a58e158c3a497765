"""The inertia about three axes in a given time, from the doublets that promise the most."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from console.experiments.client import Client
from console.experiments.inertia import FAR, ExcitedFlight
from extensions.identification.optimal_inertia.design import (
    CRITERIA,
    ROOM,
    Bounds,
    Candidate,
    Loop,
    candidates,
    choose,
)
from quadrotor.constants import GRAVITY
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters, parameter

SECONDS = 12.0


class OptimalInertiaOptions(Parameters):
    """Options of the design."""

    seconds: float = parameter(SECONDS, unit="s", ge=8.0, le=60.0, step=1.0)
    """for the excitation of all axes"""
    criterion: str = parameter("worst_axis", choices=tuple(CRITERIA))
    """worst_axis: the axis that is known least (E-optimal); all_axes: all together (D-optimal)"""
    height: float = parameter(1.2, unit="m", ge=1.0, le=1.5, step=0.1)
    """of the hover"""


class OptimalInertia(ExcitedFlight):
    """Take-off, one excitation of each axis, landing; estimated from every tick."""

    name = "inertia_optimal"

    def __init__(self, vehicle: str = "quad1") -> None:
        super().__init__(vehicle)
        self.parameters = OptimalInertiaOptions()
        self._chosen: tuple[Candidate, ...] = ()

    @property
    def planned(self) -> float:
        """Return the approximate planned time in s."""
        return 20.0 + self.parameters.seconds

    def excitations(self) -> list[dict[str, ParameterValue]]:
        """Return the arguments of each `excite` in order."""
        return [
            {
                "axis": one.axis,
                "shape": "doublet",
                "amplitude": one.amplitude,
                "duration": one.duration,
                "repeats": one.repeats,
            }
            for one in self._chosen
        ]

    def fly(self, client: Client) -> None:
        """Choose by the vehicle's gains and limits, and fly. Raises RefusedError as the inertia
        does, UsageError when the time is too short.
        """
        p = self.parameters
        offered = design_for(lambda name: float(client.parameter(name)))
        self._chosen = choose(offered, p.seconds, p.criterion)
        self.fly_at(client, p.height)


def design_for(value: Callable[[str], float]) -> dict[str, list[Candidate]]:
    """Return the candidates for each axis, for a vehicle whose parameters `value` returns."""
    lag = value("model.motor_time_constant")
    level = Loop(
        kp=value("control.position.kp_xy"),
        kv=value("control.position.kv_xy"),
        ki=value("control.position.ki_xy"),
        kr=value("control.attitude.kr_xy"),
        kw=value("control.attitude.kw_xy"),
        kf=value("control.attitude.ki_xy"),
        gravity=GRAVITY,
        tilt_max=math.tan(math.radians(value("control.limits.tilt_max"))),
        lag=lag,
    )
    yaw = Loop(
        kr=value("control.attitude.kr_z"),
        kw=value("control.attitude.kw_z"),
        kf=value("control.attitude.ki_z"),
        torque_max=value("control.limits.yaw_torque_max") / value("model.inertia_zz"),
        lag=lag,
    )
    tilt = math.radians(value("behavior.trajectory_tilt_max"))
    rate = ROOM * value("behavior.trajectory_body_rate_max")
    moved = Bounds(
        # A doublet jumps by twice its amplitude, which the vehicle answers by a tilt.
        amplitude=min(
            value("behavior.excite_position_max"), 0.5 * ROOM * GRAVITY * math.tan(tilt) / level.kp
        ),
        offset=ROOM * min(FAR, value("behavior.excite_position_max") + 0.5),
        angle=ROOM * tilt,
        rate=rate,
    )
    turned = Bounds(
        amplitude=value("behavior.excite_yaw_max"),
        offset=2.0 * ROOM * value("behavior.excite_yaw_max"),
        angle=math.inf,
        rate=rate,
    )
    along_x = candidates("x", level, moved)
    return {
        "x": along_x,
        "y": [replace(one, axis="y") for one in along_x],
        "yaw": candidates("yaw", yaw, turned),
    }
