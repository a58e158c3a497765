"""The facts about vehicle, link and station at one instant: the input of the checks."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from control.behaviors.parameters import Box
from control.keep_out import KeepOut
from vehicle_link.transport.heartbeat import LinkState


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """The inputs of the checks; None means unknown or too old."""

    link: LinkState
    clock_known: bool
    telemetry_rate: float  # packets a second
    loss: float  # share of them lost, 0..1
    mode: str | None
    armed: bool = False
    airborne: bool = False
    flags: frozenset[str] = frozenset()
    tick_rate: float = 0.0  # Hz, of the flight loop
    nominal_rate: float = 500.0  # Hz, the flight loop's nominal rate on the vehicle
    missed_share: float = 0.0  # of the flight loop's periods
    position_innovation: float | None = None  # m
    attitude_innovation: float | None = None  # rad
    consistency: float = math.nan  # mean NIS per degree of freedom; NaN without a covariance
    refused_share: float = math.nan  # of the last measurements
    pose_age: float | None = None  # s
    tracker_rate: float = 0.0  # Hz
    bearings_rate: float = 0.0  # Hz
    bearings_nominal: float = 30.0  # Hz
    tracker_nominal: float = 100.0  # Hz, expected from its parameters
    voltage: float | None = None  # V
    battery_warning: float | None = None  # V, the vehicle's own limit
    position_w: tuple[float, float, float] | None = None  # m
    tilt: float | None = None  # rad
    speed: float | None = None  # m/s, mean over the last half second
    body_rate: float | None = None  # rad/s, mean over the last half second
    gravity_off: float | None = None  # rad, specific force from the estimate's up, same mean
    body_turn: float | None = None  # rad, of the tracked body about the vertical; None: unknown
    volume: Box | None = None
    boxes: KeepOut = ()  # to keep out of
    parameters_behind: float | None = None  # s since our copy matched the vehicle's; None: never
    free_bytes: float = 0.0
    keep_free: float = 0.0  # bytes
    folder_problem: tuple[str, str] = ("", "")
    """The reason why no run can be written to its folder, and what to do; empty when one can."""
    alarms: tuple[str, ...] = ()
    notices: tuple[str, ...] = field(default=())
    """Alarms that do not prevent a flight."""
    deflection: float = 0.0  # of the stick that is deflected most; 0 without sticks
    sticks_dropped: bool = False
