"""Limits of the pre-flight check list; the page and ROS 2 see them as `station.preflight.*`."""

from __future__ import annotations

from quadrotor.parameters import Parameters, parameter


class PreflightParameters(Parameters):
    """The conditions for passing a request to arm on to the vehicle."""

    blocks: bool = parameter(True, read_only=True)
    """the station refuses to arm while a check fails"""
    telemetry_rate_min: float = parameter(50.0, unit="Hz", ge=0, le=100, step=5)
    """fewest telemetry packets a second"""
    loss_max: float = parameter(0.1, ge=0, le=1, step=0.01)
    """share of lost telemetry that is worth a word"""
    tracker_share_min: float = parameter(0.5, ge=0, le=1, step=0.05)
    """fewest poses a second from the tracker, as a share of its rate"""
    pose_age_max: float = parameter(0.1, unit="s", ge=0.01, le=1, step=0.01)
    """oldest pose the estimate may rest on"""
    position_innovation_max: float = parameter(0.1, unit="m", ge=0.001, le=2, step=0.01)
    """largest distance of a measured pose from the estimate"""
    attitude_innovation_max: float = parameter(5.0, unit="°", ge=0.1, le=45, step=0.5)
    """the same of attitude"""
    consistency_max: float = parameter(3.0, ge=1.0, le=100.0, step=0.5)
    """largest mean square of the estimate's innovations, expected: 1"""
    refused_share_max: float = parameter(0.5, ge=0.0, le=1.0, step=0.05)
    """largest share of measurements refused"""
    battery_min: float = parameter(14.0, unit="V", ge=2.5, le=30, step=0.1)
    """lowest battery voltage; safety.battery_warning where that is higher"""
    tilt_max: float = parameter(10.0, unit="°", ge=1, le=45, step=1)
    """largest tilt on the ground"""
    speed_max: float = parameter(0.1, unit="m/s", ge=0.01, le=1, step=0.01)
    """fastest that counts as still"""
    body_rate_max: float = parameter(10.0, unit="°/s", ge=0.5, le=90, step=0.5)
    """the same of turning"""
    stick_deflection_max: float = parameter(0.1, ge=0, le=1, step=0.01)
    """largest deflection of a stick that counts as centred"""
