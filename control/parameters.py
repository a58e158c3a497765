"""Gains and limits of the controller, and the record that the compiled laws read.

Gains are per unit mass and per unit inertia, so that they keep their meaning when the mass estimate
changes. The defaults fly the paper's vehicle at 60 to 1000 Hz.
"""

from __future__ import annotations

import math

import numpy as np

from quadrotor.parameters import Parameters, parameter
from quadrotor.records import Record

CONTROL = np.dtype(
    [
        ("kp", "f8", 3),  # 1/s^2, K_p of eq. 4 over the mass, world axes
        ("kv", "f8", 3),  # 1/s
        ("ki", "f8", 3),  # 1/s^3
        ("kr", "f8", 3),  # 1/s^2, K_R of eq. 5 over the inertia, body axes
        ("kw", "f8", 3),  # 1/s
        ("kf", "f8", 3),  # 1/s^3
        ("tan_tilt_max", "f8"),
        ("position_integral_max", "f8"),  # m s, each axis
        ("attitude_integral_max", "f8"),  # rad s, each axis
        ("yaw_torque_max", "f8"),  # N m
        ("exact_rates", "i8"),  # 1: omega_d from the exact f_d', f_d''; 0: from the nominal
    ],
    align=True,
)


RATES = ("nominal", "exact")
GEOMETRIC, NEAR_HOVERING, NONE = "geometric", "near_hovering", "none"


def _gain(
    default: float, largest: float, unit: str, description: str, flight_step: float | None = None
) -> float:
    """Return a gain parameter that may change in flight by `flight_step` at once.

    The step allows every change between two named sets; by default it is a fifth of the range.
    """
    value: float = parameter(
        default,
        unit=unit,
        ge=0.0,
        le=largest,
        step=largest / 200.0,
        description=description,
        flight_step=largest / 5.0 if flight_step is None else flight_step,
    )
    return value


class PositionGains(Parameters):
    """Eq. 4, per unit mass."""

    kp_xy: float = _gain(4.0, 20.0, "1/s²", "position gain, horizontal")
    kp_z: float = _gain(8.0, 20.0, "1/s²", "position gain, vertical")
    kv_xy: float = _gain(3.5, 10.0, "1/s", "velocity gain, horizontal")
    kv_z: float = _gain(5.0, 10.0, "1/s", "velocity gain, vertical")
    ki_xy: float = _gain(1.0, 5.0, "1/s³", "position integral gain, horizontal")
    ki_z: float = _gain(2.0, 5.0, "1/s³", "position integral gain, vertical")


class AttitudeGains(Parameters):
    """Eq. 5, per unit inertia."""

    kr_xy: float = _gain(60.0, 200.0, "1/s²", "attitude gain, roll and pitch", flight_step=45.0)
    kr_z: float = _gain(12.0, 50.0, "1/s²", "attitude gain, yaw")
    kw_xy: float = _gain(12.0, 40.0, "1/s", "angular velocity gain, roll and pitch")
    kw_z: float = _gain(5.0, 20.0, "1/s", "angular velocity gain, yaw")
    ki_xy: float = _gain(10.0, 50.0, "1/s³", "attitude integral gain, roll and pitch")
    ki_z: float = _gain(2.0, 20.0, "1/s³", "attitude integral gain, yaw")
    rates: str = parameter("nominal", choices=RATES)
    """desired angular velocity from the nominal force (as the paper) or from the exact one (75° of
    phase margin instead of 31°, softer against a constant force)"""


class ControlLimits(Parameters):
    """The limits of tilt, integrals and yaw torque."""

    tilt_max: float = parameter(45.0, unit="°", ge=5.0, le=70.0, step=1.0, flight_step=15.0)
    """largest tilt of the desired force"""
    position_integral_max: float = parameter(1.0, unit="m s", ge=0.0, le=5.0, step=0.05)
    """bound of each axis of ∫e_p"""
    attitude_integral_max: float = parameter(0.3, unit="rad s", ge=0.0, le=2.0, step=0.01)
    """bound of each axis of ∫e_R"""
    yaw_torque_max: float = parameter(0.1, unit="N m", ge=0.0001, le=1.0, step=0.0001)
    """largest yaw torque; more would scale roll and pitch down with it"""


class DisturbanceParameters(Parameters):
    """Settings of the disturbance observer, and whether the law takes off what it finds."""

    force: bool = parameter(False)
    """take the disturbing force found (wind, payload, weak motors) off the desired one; faded in
    and out"""
    torque: bool = parameter(False)
    """take the disturbing torque found (a weak motor, a load off the centre) off the one of the
    law; faded in and out"""
    force_bandwidth: float = parameter(
        14.0, unit="rad/s", ge=0.1, le=20.0, step=0.1, flight_step=5.0
    )
    """low pass of the force found"""
    torque_bandwidth: float = parameter(
        0.8, unit="rad/s", ge=0.05, le=15.0, step=0.05, flight_step=3.0
    )
    """low pass of the torque found; costs margin at the motors"""
    force_max: float = parameter(6.0, unit="N", ge=0.0, le=10.0, step=0.1, flight_step=2.0)
    """largest force taken off, each world axis"""
    torque_max: float = parameter(0.2, unit="N m", ge=0.0, le=1.0, step=0.01, flight_step=0.2)
    """largest torque taken off, each body axis"""
    fade: float = parameter(1.0, unit="s", ge=0.1, le=10.0, step=0.1)
    """time to fade in after take-off or switching on, and out after switching off; at least three
    time constants of the low pass"""


class PluginBounds(Parameters):
    """Bounds beyond which an external law is disengaged, and where one over UDP answers."""

    thrust_max: float = parameter(0.5, ge=0.05, le=2.0, step=0.05)
    """largest difference of thrust from the built-in law's, in weights"""
    torque_max: float = parameter(0.5, unit="N m", ge=0.05, le=5.0, step=0.05)
    """largest difference of torque from the built-in law's, about each axis"""
    tilt_max: float = parameter(20.0, unit="°", ge=2.0, le=60.0, step=1.0)
    """largest tilt away from the built-in law's desired attitude"""
    distance_max: float = parameter(0.5, unit="m", ge=0.05, le=5.0, step=0.05)
    """largest distance from the reference"""
    udp_peer: str = parameter("127.0.0.1:9101")
    """ADDRESS:PORT (IPv4) of the program that is the law `udp`"""
    udp_port: int = parameter(9102, ge=1024, le=65535)
    """port of the vehicle that it answers to"""


class ControlParameters(Parameters):
    """The parameters of the controller."""

    law: str = parameter(GEOMETRIC)
    """geometric (the paper's), near_hovering (its linear form), a law of an extension, udp (a
    program that answers over UDP), or a file of the folder plugins, without its ending (one written
    since the start is listed after the next start); changed on the ground, in flight only between
    geometric and a law that runs next to it"""
    shadow_law: str = parameter(NONE)
    """a law that is not built in, listed as for law, which runs next to the one in use and is
    compared with it; none: no law"""
    position: PositionGains = PositionGains()
    attitude: AttitudeGains = AttitudeGains()
    limits: ControlLimits = ControlLimits()
    disturbance: DisturbanceParameters = DisturbanceParameters()
    plugin: PluginBounds = PluginBounds()


def control_record(parameters: ControlParameters) -> Record:
    """Return the parameters as one CONTROL record, shape (1,)."""
    position, attitude, limits = parameters.position, parameters.attitude, parameters.limits
    out = np.zeros(1, CONTROL)
    out["kp"] = (position.kp_xy, position.kp_xy, position.kp_z)
    out["kv"] = (position.kv_xy, position.kv_xy, position.kv_z)
    out["ki"] = (position.ki_xy, position.ki_xy, position.ki_z)
    out["kr"] = (attitude.kr_xy, attitude.kr_xy, attitude.kr_z)
    out["kw"] = (attitude.kw_xy, attitude.kw_xy, attitude.kw_z)
    out["kf"] = (attitude.ki_xy, attitude.ki_xy, attitude.ki_z)
    out["tan_tilt_max"] = math.tan(math.radians(limits.tilt_max))
    out["position_integral_max"] = limits.position_integral_max
    out["attitude_integral_max"] = limits.attitude_integral_max
    out["yaw_torque_max"] = limits.yaw_torque_max
    out["exact_rates"] = int(attitude.rates == "exact")
    return out
