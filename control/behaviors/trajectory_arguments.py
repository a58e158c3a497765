"""The arguments of each trajectory of follow_trajectory, and all of them as one flat form.

A trajectory's own class holds its arguments; an argument that several share is one field of a
common base class. The form from which the page is built is the union.
"""

from __future__ import annotations

from quadrotor.parameters import Parameters, parameter

TRAJECTORIES = ("figure_eight", "figure_eight_lap", "circle", "helix", "line", "waypoints", "file")


class WhichTrajectory(Parameters):
    """The argument that all of them start with."""

    trajectory: str = parameter("figure_eight", choices=TRAJECTORIES)
    """which one"""


class PeriodArguments(WhichTrajectory):
    """Arguments of a trajectory that is flown in laps."""

    period: float = parameter(8.0, unit="s", ge=2.0, le=60.0, step=0.5)
    """figure_eight, figure_eight_lap, circle, helix: time of one lap"""


class LapArguments(PeriodArguments):
    """The arguments of laps at a constant rate between ramps."""

    laps: int = parameter(3, ge=1, le=1000, step=1)
    """figure_eight, circle, helix: number of laps"""
    ramp: float = parameter(3.0, unit="s", ge=0.5, le=30.0, step=0.5)
    """figure_eight, circle, helix: time to the full rate and back"""


class EightShape(WhichTrajectory):
    """Size of the 8."""

    width: float = parameter(1.0, unit="m", ge=0.0, le=20.0, step=0.1)
    """figure_eight, figure_eight_lap: size in x"""
    height: float = parameter(1.0, unit="m", ge=0.0, le=20.0, step=0.1)
    """figure_eight, figure_eight_lap: size in y"""
    z_amplitude: float = parameter(0.2, unit="m", ge=0.0, le=5.0, step=0.05)
    """figure_eight, figure_eight_lap: up and down by this"""
    yaw_amplitude: float = parameter(1.0, unit="rad", ge=0.0, le=3.1, step=0.1)
    """figure_eight, figure_eight_lap: yaw to both sides by this"""


class FigureEightArguments(EightShape, LapArguments):
    """The arguments of figure_eight; the defaults are those of the paper's second experiment."""


class FigureEightLapArguments(EightShape, PeriodArguments):
    """The arguments of figure_eight_lap: one lap from rest to rest in `period`."""


class CircleArguments(LapArguments):
    """The arguments of circle."""

    radius: float = parameter(0.8, unit="m", ge=0.05, le=20.0, step=0.1)
    """circle, helix: radius"""
    nose: str = parameter("fixed", choices=("fixed", "tangent", "center"))
    """circle, helix: where the nose points; the centre is abeam, ahead for center"""
    side: str = parameter("left", choices=("left", "right"))
    """circle, helix: left turns counter-clockwise, right clockwise"""


class HelixArguments(CircleArguments):
    """The arguments of helix."""

    rise: float = parameter(0.2, unit="m", ge=-5.0, le=5.0, step=0.05)
    """helix: climb of one lap"""


class PaceArguments(WhichTrajectory):
    """Bounds of a trajectory that is flown as fast as they allow."""

    speed: float = parameter(0.8, unit="m/s", ge=0.05, le=5.0, step=0.05)
    """line, waypoints: largest speed; behavior.fly_to_speed if left out"""
    acceleration: float = parameter(1.5, unit="m/s²", ge=0.1, le=8.0, step=0.1)
    """line, waypoints: largest acceleration; behavior.acceleration_max if left out"""


class LineArguments(PaceArguments):
    """The arguments of line; the end, where what is left out stays as it is."""

    x: float = parameter(0.0, unit="m", ge=-100.0, le=100.0, step=0.1)
    """line: end's x"""
    y: float = parameter(0.0, unit="m", ge=-100.0, le=100.0, step=0.1)
    """line: end's y"""
    z: float = parameter(1.0, unit="m", ge=-100.0, le=100.0, step=0.1)
    """line: end's z"""
    yaw: float = parameter(0.0, unit="rad", ge=-6.3, le=6.3, step=0.05)
    """line: yaw, turned the short way"""
    jerk: float = parameter(10.0, unit="m/s³", ge=0.5, le=100.0, step=0.5)
    """line: largest jerk"""


class WaypointArguments(PaceArguments):
    """The arguments of waypoints, a path of least snap."""

    waypoints: str = parameter("")
    """waypoints: 'x y z yaw; x y z; ...' in m and rad, world axes, up to 12; the yaw is kept where
    left out"""


class FileArguments(WhichTrajectory):
    """The arguments of file."""

    file: str = parameter("")
    """file: name, without ending, of one loaded from the trajectory folder"""
    anchor: str = parameter("world", choices=("world", "here"))
    """file: world flies it where it was written, here from this place and yaw"""
    time_factor: float = parameter(1.0, ge=0.2, le=20.0, step=0.1)
    """file: above 1 flies it slower"""


class FollowTrajectoryArguments(
    FigureEightArguments, HelixArguments, LineArguments, WaypointArguments, FileArguments
):
    """The arguments of follow_trajectory: every argument of every trajectory. Those of another are
    refused.
    """
