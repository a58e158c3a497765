"""The options of the experiment `formation`, `experiment.NAME`."""

from __future__ import annotations

from bearing_sim.bearing_parameters import BearingParameters
from quadrotor.parameters import Parameters, parameter


class MessageParameters(Parameters):
    """The messages between the vehicles."""

    loss: float = parameter(0.0, ge=0, le=1, step=0.05)
    """share of the messages that each receiver loses"""
    delay: float = parameter(0.02, unit="s", ge=0, le=1, step=0.01)
    """from sender to receiver"""
    clock: float = parameter(0.0, unit="s", ge=-100, le=100, step=0.1)
    """by which the stamps of this vehicle's own clock are ahead of those of the others"""
    cut: float = parameter(0.0, unit="s", ge=0, le=600, step=1)
    """time from which this vehicle neither sends nor hears; 0: never"""


class FormationOptions(Parameters):
    """Options of the experiment."""

    desired: str = parameter("")
    """desired bearings: 'observer observed azimuth elevation; …', vehicles from 1, deg in the
    observer's yaw frame; empty: a pyramid of all, each seeing all others; facing: five that look
    at each other, for a field of view of 90 deg"""
    converge: float = parameter(25.0, unit="s", ge=5, le=120, step=1)
    """from the random starts to the formation"""
    hold: float = parameter(10.0, unit="s", ge=2, le=120, step=1)
    """in which the steady formation is judged"""
    steered: float = parameter(20.0, unit="s", ge=0, le=120, step=1)
    """steered by null motions afterwards; 0 is not steered"""
    speed: float = parameter(0.5, unit="m/s", ge=0, le=1, step=0.05)
    """largest commanded speed of the centroid"""
    yaw_rate: float = parameter(0.3, unit="rad/s", ge=0, le=1, step=0.05)
    """largest commanded rate about the centroid"""
    scale_rate: float = parameter(0.1, unit="1/s", ge=0, le=0.3, step=0.01)
    """largest commanded rate of all distances"""
    gain: float = parameter(0.8, unit="m/s", ge=0.1, le=3, step=0.1)
    """K of the law"""
    eigenvalue_min: float = parameter(0.02, ge=0, le=1, step=0.005)
    """bound of the rigidity eigenvalue, at which commanded motions stop"""
    fails: int = parameter(0, ge=0, le=8, step=1)
    """vehicle, from 1, that lands in the middle of the hold; 0 none"""
    joins: int = parameter(0, ge=0, le=8, step=1)
    """vehicle, from 1, that joins from the ground 15 s before the hold; 0 none"""
    near: float = parameter(0.0, unit="m", ge=0, le=0.5, step=0.05)
    """largest distance, on each axis, of the starts from the desired formation; 0: anywhere"""
    turn: float = parameter(1.0, unit="rad", ge=0, le=3, step=0.05)
    """largest yaw of the starts from the desired one"""
    crossing: bool = parameter(False)
    """the paths from the starts cross, as a test of the separation"""
    occlusion: bool = parameter(True)
    """vehicles hide those behind them"""
    bearings: BearingParameters = BearingParameters()
    messages: MessageParameters = MessageParameters()
