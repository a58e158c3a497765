"""The numbers in a message type: the path of each, how to read it from a message, and its unit as
the .msg files document it; nested fields inherit units.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple

from rosbags.interfaces import Nodetype

from vehicle_link.messages.store import stored_name, typestore

Path = tuple[str | int, ...]

TIMES = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
"""Types that are not values but say when values were valid."""


class Number(NamedTuple):
    """One number (or boolean) of a message."""

    path: Path  # ("pose", "pose", "position", "x"); array members by index
    fields: tuple[tuple[str, str], ...]  # message type and field, from the outermost in


def numbers(type_name: str, members: int) -> list[Number]:
    """Return the numbers of a message of this type, in its order, without its times.

    Args:
        members: number of members of an array without a fixed length.
    """
    return list(_walk(stored_name(type_name), members, (), ()))


def _walk(
    type_name: str, members: int, path: Path, fields: tuple[tuple[str, str], ...]
) -> Iterator[Number]:
    fielddefs: Any = typestore().fielddefs[type_name][1]
    for name, (kind, details) in fielddefs:
        place, chain = (*path, name), (*fields, (type_name, name))
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            (item_kind, item), length = details
            for i in range(length if kind == Nodetype.ARRAY else members):
                yield from _one(item_kind, item, members, (*place, i), chain)
        else:
            yield from _one(kind, details, members, place, chain)


def _one(
    kind: Any, details: Any, members: int, path: Path, fields: tuple[tuple[str, str], ...]
) -> Iterator[Number]:
    if kind == Nodetype.NAME:
        if details not in TIMES:
            yield from _walk(details, members, path, fields)
    elif details[0] not in ("string", "wstring"):
        yield Number(path, fields)


_UNITS: dict[str, dict[str, str]] = {
    "geometry_msgs/msg/Pose": {"position": "m"},
    "geometry_msgs/msg/Twist": {"linear": "m/s", "angular": "rad/s"},
    "sensor_msgs/msg/Imu": {"angular_velocity": "rad/s", "linear_acceleration": "m/s²"},
    "sensor_msgs/msg/FluidPressure": {"fluid_pressure": "Pa", "variance": "Pa²"},
    "sensor_msgs/msg/BatteryState": {
        "voltage": "V",
        "temperature": "°C",
        "current": "A",
        "charge": "Ah",
        "capacity": "Ah",
        "design_capacity": "Ah",
        "cell_voltage": "V",
        "cell_temperature": "°C",
    },
    "quadlab_msgs/msg/Actuators": {
        "thrust": "N",
        "torque": "N m",
        "thrusts": "N",
        "motor_references": "count",
    },
    "quadlab_msgs/msg/Mark": {"time": "s"},
    "quadlab_msgs/msg/Reference": {
        "jerk": "m/s³",
        "snap": "m/s⁴",
        "yaw_rate": "rad/s",
        "yaw_acceleration": "rad/s²",
    },
    "quadlab_msgs/msg/EstimatorStatus": {
        "mass": "kg",
        "mass_variance": "kg²",
        "accelerometer_bias": "m/s²",
        "gyroscope_bias": "rad/s",
        "measurement_age": "s",
        "position_innovation": "m",
        "attitude_innovation": "rad",
        "position_variance": "m²",
        "velocity_variance": "m²/s²",
        "attitude_variance": "rad²",
    },
    "quadlab_msgs/msg/EstimatorComparison": {"duration": "s", "sigma": "rad"},
    "quadlab_msgs/msg/EstimatorResult": {
        "velocity": "m/s",
        "position_covariance": "m²",
        "attitude_variance": "rad²",
        "position_error": "m",
        "position_rms": "m",
        "position_max": "m",
        "position_rms_recent": "m",
        "position_max_recent": "m",
        "attitude_error": "rad",
        "attitude_rms": "rad",
        "attitude_max": "rad",
        "attitude_rms_recent": "rad",
        "attitude_max_recent": "rad",
        "residuals": "rad",
    },
    "quadlab_msgs/msg/BearingArray": {"sigma": "rad"},
    "quadlab_msgs/msg/SweepArray": {
        "tilt": "rad",
        "phase": "rad",
        "gib_magnitude": "rad",
        "gib_phase": "rad",
        "curve": "1/rad",
        "sensors": "m",
        "angles": "rad",
        "sigma": "rad",
    },
    "quadlab_msgs/msg/VehicleStatus": {
        "tick_rate": "Hz",
        "lateness_p50": "s",
        "lateness_p99": "s",
        "lateness_max": "s",
        "nominal_rate": "Hz",
        "suspect_offset": "rad",
        "shadow_ready": "s",
        "shadow_deviation": "m",
        "shadow_distance": "m",
        "oscillation_frequency": "Hz",
        "board_command_rate": "Hz",
        "board_round_trip": "s",
    },
    "quadlab_msgs/msg/StationStatus": {
        "recording_duration": "s",
        "recording_bytes": "B",
        "free_bytes": "B",
        "tracker_rate": "Hz",
    },
    "quadlab_msgs/msg/LinkStatus": {
        "round_trip": "s",
        "clock_offset": "s",
        "jitter": "s",
        "age": "s",
        "telemetry_rate": "Hz",
        "state_duration": "s",
        "outage_last": "s",
        "outage_longest": "s",
        "outage_total": "s",
    },
    "quadlab_msgs/msg/CameraFigures": {"picture_rate": "Hz"},
    "quadlab_msgs/msg/TrackerStatus": {
        "frame_rate": "Hz",
        "latency": "s",
        "latency_p99": "s",
        "clock_drift": "s/s",
    },
    "quadlab_msgs/msg/Transfer": {"bytes": "B", "total_bytes": "B", "rate": "B/s"},
    "quadlab_msgs/msg/ExperimentStatus": {"elapsed": "s", "planned": "s"},
}


def unit_of_path(type_name: str, path: str) -> str:
    """Return the unit of a number by its path without array indices (`pose.pose.position.x`)."""
    return _units_of(type_name).get(path, "")


@cache
def _units_of(type_name: str) -> dict[str, str]:
    try:
        found = numbers(type_name, 1)
    except KeyError:  # a type of another program's log
        return {}
    return {
        ".".join(step for step in path if isinstance(step, str)): unit_of(fields)
        for path, fields in found
    }


def unit_of(fields: Sequence[tuple[str, str]]) -> str:
    """Return the innermost known unit; empty when there is none or it is not known.

    Args:
        fields: message type (`nav_msgs/msg/Odometry`) and field, from the outermost inwards.
    """
    known = [_UNITS.get(type_name, {}).get(field, "") for type_name, field in fields]
    return next((unit for unit in reversed(known) if unit), "")
