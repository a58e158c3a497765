"""The limits of where and how fast behaviors may fly."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from control.keep_out import PARAMETER, KeepOut, Vector, parse_keep_out
from quadrotor.errors import OutOfBoundsError
from quadrotor.parameters import Parameters, parameter

NONE = "none"
Box = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
"""Lowest and highest x, y and z, m."""


def _wall(default: float, description: str) -> float:
    value: float = parameter(
        default, unit="m", ge=-100.0, le=100.0, step=0.1, description=description
    )
    return value


class BehaviorParameters(Parameters):
    """The flight volume, keep-out boxes, the default speeds and the landing detector."""

    volume_x_min: float = _wall(-3.0, "flight volume, smallest x")
    volume_x_max: float = _wall(3.0, "flight volume, largest x")
    volume_y_min: float = _wall(-3.0, "flight volume, smallest y")
    volume_y_max: float = _wall(3.0, "flight volume, largest y")
    volume_z_min: float = _wall(0.2, "flight volume, lowest reference in flight")
    volume_z_max: float = _wall(3.0, "flight volume, highest reference")
    keep_out: str = parameter(NONE)
    """boxes that no path comes near: 'name x_min x_max y_min y_max z_min z_max; ...' in m, or
    none"""
    keep_out_margin: float = parameter(0.4, unit="m", ge=0.05, le=2.0, step=0.05)
    """distance of references from keep-out boxes: the vehicle's radius and what it strays"""
    take_off_speed: float = parameter(0.4, unit="m/s", ge=0.05, le=2.0, step=0.05)
    """climb speed of take_off"""
    take_off_probe: float = parameter(1.5, unit="°", ge=0.0, le=5.0, step=0.5)
    """tilt of a small circle at lift-off that shows a tracker with wrong axes; 0 = none"""
    landing_speed: float = parameter(0.3, unit="m/s", ge=0.05, le=1.0, step=0.05)
    """descent speed of land"""
    emergency_landing_speed: float = parameter(0.5, unit="m/s", ge=0.2, le=0.8, step=0.05)
    """descent by the barometer of emergency_landing"""
    fly_to_speed: float = parameter(0.8, unit="m/s", ge=0.05, le=5.0, step=0.05)
    """speed of fly_to"""
    acceleration_max: float = parameter(1.5, unit="m/s²", ge=0.1, le=5.0, step=0.1)
    """acceleration of take_off, fly_to and land"""
    trajectory_acceleration_max: float = parameter(4.0, unit="m/s²", ge=0.1, le=8.0, step=0.1)
    """steepest trajectory accepted"""
    trajectory_speed_max: float = parameter(3.0, unit="m/s", ge=0.1, le=10.0, step=0.1)
    """quickest trajectory accepted"""
    trajectory_tilt_max: float = parameter(35.0, unit="°", ge=5.0, le=60.0, step=1.0)
    """largest tilt a trajectory may ask for; leave some to the feedback"""
    trajectory_body_rate_max: float = parameter(3.5, unit="rad/s", ge=0.5, le=10.0, step=0.1)
    """largest body rate a trajectory may ask for; the gyroscopes end at 5.2"""
    trajectory_yaw_torque_max: float = parameter(0.07, unit="N m", ge=0.0001, le=1.0, step=0.0001)
    """largest yaw torque a trajectory may ask for; the motors give about 0.1"""
    trajectory_thrust_margin: float = parameter(0.1, ge=0.0, le=0.45, step=0.01)
    """share of each motor's thrust range that trajectories leave to the feedback, at both ends"""
    yaw_rate_max: float = parameter(1.5, unit="rad/s", ge=0.1, le=4.0, step=0.1)
    """largest yaw rate of a reference"""
    yaw_acceleration_max: float = parameter(2.5, unit="rad/s²", ge=0.1, le=4.0, step=0.1)
    """largest yaw acceleration of a reference; the motors give about 4"""
    joy_speed_xy: float = parameter(1.0, unit="m/s", ge=0.05, le=5.0, step=0.05)
    """full stick forward or left"""
    joy_speed_z: float = parameter(0.5, unit="m/s", ge=0.05, le=2.0, step=0.05)
    """full stick up"""
    joy_yaw_rate: float = parameter(1.0, unit="rad/s", ge=0.05, le=4.0, step=0.05)
    """full stick yaw"""
    joy_tilt: float = parameter(12.0, unit="°", ge=1.0, le=30.0, step=0.5)
    """near_hovering: full stick forward or left"""
    joy_thrust: float = parameter(0.3, ge=0.05, le=0.6, step=0.05)
    """near_hovering without altitude hold: full stick up, in weights"""
    joy_acceleration: float = parameter(2.0, unit="m/s²", ge=0.1, le=5.0, step=0.1)
    """how fast sticks change the speed"""
    joy_timeout: float = parameter(0.2, unit="s", ge=0.05, le=1.0, step=0.01)
    """older sticks count as released"""
    brake_deceleration: float = parameter(2.5, unit="m/s²", ge=0.2, le=6.0, step=0.1)
    """deceleration of brake"""
    excite_position_max: float = parameter(0.6, unit="m", ge=0.05, le=2.0, step=0.05)
    """largest step of excite on x, y, z"""
    excite_yaw_max: float = parameter(0.8, unit="rad", ge=0.05, le=3.0, step=0.05)
    """largest step of excite on yaw; it brakes when the yaw is further off its path"""
    excite_error_max: float = parameter(0.5, unit="m", ge=0.05, le=2.0, step=0.05)
    """excite brakes when the vehicle is further off the path on any axis"""
    plugin: str = parameter(NONE)
    """a file of plugins (one written since the start is listed after the next start) or of a
    package, whose references external flies; none: those of the topic external_reference"""
    external_timeout: float = parameter(0.2, unit="s", ge=0.05, le=1.0, step=0.01)
    """external brakes when the newest reference is older"""
    external_step_max: float = parameter(0.2, unit="m", ge=0.01, le=1.0, step=0.01)
    """external: largest step from where the last reference leads"""
    landing_thrust_share: float = parameter(0.6, ge=0.35, le=0.9, step=0.05)
    """touch-down: thrust below this share of the weight"""
    landing_dwell: float = parameter(0.1, unit="s", ge=0.05, le=2.0, step=0.05)
    """touch-down: for this long"""
    landing_velocity_change: float = parameter(0.2, unit="m/s", ge=0.02, le=1.0, step=0.01)
    """touch-down: while the velocity changes by less than this"""

    @property
    def low_w(self) -> Vector:
        """Return the lowest corner of the flight volume, m."""
        return (self.volume_x_min, self.volume_y_min, self.volume_z_min)

    @property
    def high_w(self) -> Vector:
        """Return the highest corner of the flight volume, m."""
        return (self.volume_x_max, self.volume_y_max, self.volume_z_max)

    @property
    def boxes(self) -> KeepOut:
        """Return the keep-out boxes. Raises OutOfBoundsError for a text that was not checked."""
        return parse_keep_out(self.keep_out)


def flight_volume(value: Callable[[str], Any]) -> Box | None:
    """Return the flight volume, or None while it is not known.

    Args:
        value: returns the value of a parameter by its full name, None if not known.
    """
    x, y, z = (
        (value(f"behavior.volume_{axis}_min"), value(f"behavior.volume_{axis}_max"))
        for axis in "xyz"
    )
    known = all(isinstance(wall, int | float) for side in (x, y, z) for wall in side)
    return (x, y, z) if known else None


def keep_out(value: Callable[[str], Any]) -> KeepOut:
    """Return the keep-out boxes, none of a vehicle or a log of another version; `value` as for the
    flight volume.
    """
    with suppress(OutOfBoundsError):
        return parse_keep_out(str(value(PARAMETER) or NONE))
    return ()
