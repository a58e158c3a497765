"""The arguments of the behaviors that the page starts; no function here is compiled."""

from __future__ import annotations

from control.behaviors.trajectory_arguments import FollowTrajectoryArguments
from quadrotor.parameters import Parameters, parameter


class TakeOffArguments(Parameters):
    """The arguments of take_off."""

    height: float = parameter(1.0, unit="m", ge=0.2, le=20.0, step=0.1)
    """above the start position"""
    speed: float = parameter(0.4, unit="m/s", ge=0.02, le=2.0, step=0.05)
    """climb speed; behavior.take_off_speed if left out"""


class FlyToArguments(Parameters):
    """The arguments of fly_to; what is left out stays as it is."""

    x: float = parameter(0.0, unit="m", ge=-100.0, le=100.0, step=0.1)
    """world x"""
    y: float = parameter(0.0, unit="m", ge=-100.0, le=100.0, step=0.1)
    """world y"""
    z: float = parameter(1.0, unit="m", ge=-100.0, le=100.0, step=0.1)
    """world z"""
    yaw: float = parameter(0.0, unit="rad", ge=-6.3, le=6.3, step=0.05)
    """yaw, turned the short way"""
    speed: float = parameter(0.8, unit="m/s", ge=0.05, le=5.0, step=0.05)
    """largest speed; behavior.fly_to_speed if left out"""


class LandArguments(Parameters):
    """The arguments of land."""

    speed: float = parameter(0.3, unit="m/s", ge=0.05, le=1.0, step=0.05)
    """descent speed; behavior.landing_speed if left out"""


class NearHoveringArguments(Parameters):
    """The arguments of near_hovering."""

    hold_altitude: bool = parameter(True)
    """hold the climb rate by the barometer; false: the stick is thrust"""


ARGUMENTS: dict[str, type[Parameters]] = {
    "take_off": TakeOffArguments,
    "fly_to": FlyToArguments,
    "follow_trajectory": FollowTrajectoryArguments,
    "land": LandArguments,
    "near_hovering": NearHoveringArguments,
}
"""Arguments by behavior; the other behaviors of the page have none."""
