"""The slow topics of the vehicle: status, estimator, battery, pressure, events."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cache

import numpy as np

from quadrotor.records import Record
from vehicle_link.commands import EventKind
from vehicle_link.messages import encode, header, new, time_message
from vehicle_link.messages.cdr_layout import FixedLayout, payloads_of
from vehicle_link.messages.records import Log
from vehicle_link.topics.ticks import VEHICLE, WORLD, body_frame, layout, set_stamps

LIPO = 3  # POWER_SUPPLY_TECHNOLOGY_LIPO
DISCHARGING = 2  # POWER_SUPPLY_STATUS_DISCHARGING


@cache
def _shared(record: np.dtype[np.void], message: np.dtype[np.void]) -> tuple[str, ...]:
    """Return the numbers that a record and a message have under the same name."""
    return tuple(name for name in message.names or () if name in (record.names or ()))


@cache
def _status_layout(mode: str, behavior: str, control_mode: str) -> FixedLayout:
    """Return the layout of a status without flags."""
    strings = {
        "header.frame_id": WORLD,
        "mode": mode,
        "behavior": behavior,
        "control_mode": control_mode,
    }
    return FixedLayout("quadlab_msgs/VehicleStatus", strings)


def encode_status(
    tick: Record,
    mode: str,
    behavior: str,
    flags: Sequence[str],
    control_mode: str = "direct",
    instance: int = 0,
) -> bytes:
    """Encode `status`: quadlab_msgs/VehicleStatus of one TICK record, shape (1,).

    The texts are arguments because their enums are in the layers above; `instance` is the
    vehicle's.
    """
    status = tick["status"][0]
    out = _status_layout(mode, behavior, control_mode).new()
    shared = _shared(status.dtype, out.dtype)
    if not flags:  # almost always; only numbers change then
        set_stamps(out, int(tick["imu"]["stamp_ns"][0]))
        for field in shared:
            out[field] = status[field]
        out["instance"] = instance
        return out.tobytes()
    return encode(
        new(
            "quadlab_msgs/VehicleStatus",
            header=header(int(tick["imu"]["stamp_ns"][0])),
            mode=mode,
            behavior=behavior,
            control_mode=control_mode,
            flags=flags,
            instance=instance,
            **{field: status[field] for field in shared},
        )
    )


@cache
def _estimator_layout(estimator: str) -> FixedLayout:
    strings = {"header.frame_id": WORLD, "estimator": estimator}
    return FixedLayout("quadlab_msgs/EstimatorStatus", strings)


def encode_estimators(ticks: Record, estimator: str) -> list[bytes]:
    """Encode `estimator`: quadlab_msgs/EstimatorStatus of TICK records, shape (N,)."""
    out, source = _estimator_layout(estimator).new(len(ticks)), ticks["estimate"]
    set_stamps(out, ticks["imu"]["stamp_ns"])
    for field in _shared(source.dtype, out.dtype):
        out[field] = source[field]
    out["accelerometer_bias"] = source["accelerometer_bias_b"]
    out["gyroscope_bias"] = source["gyroscope_bias_b"]
    out["position_innovation"] = source["position_innovation_w"]
    out["attitude_innovation"] = source["attitude_innovation_b"]
    for field in ("position_variance", "velocity_variance", "attitude_variance"):
        out[field] = source[f"{field}_w"]
    return payloads_of(out)


def encode_batteries(ticks: Record, vehicle: str = VEHICLE) -> list[bytes]:
    """Encode `battery`: sensor_msgs/BatteryState of TICK records; only the voltage is measured."""
    out = layout("sensor_msgs/BatteryState", body_frame(vehicle)).new(len(ticks))
    set_stamps(out, ticks["imu"]["stamp_ns"])
    out["voltage"] = ticks["status"]["battery_voltage"]
    for field in ("temperature", "current", "charge", "capacity", "design_capacity", "percentage"):
        out[field] = np.nan  # by convention of the message: not measured
    out["power_supply_status"] = DISCHARGING
    out["power_supply_technology"] = LIPO
    out["present"] = True
    return payloads_of(out)


def encode_pressures(ticks: Record, vehicle: str = VEHICLE) -> list[bytes]:
    """Encode `pressure`: sensor_msgs/FluidPressure (Pa) of TICK records; variance 0 = unknown."""
    out = layout("sensor_msgs/FluidPressure", body_frame(vehicle)).new(len(ticks))
    set_stamps(out, ticks["imu"]["stamp_ns"])
    out["fluid_pressure"] = ticks["status"]["pressure"]
    return payloads_of(out)


DELAYED_PREFIX = "while the station sent nothing: "
"""Beginning of an event that repeats what the vehicle reported while the station had no contact."""


def encode_event(
    stamp_ns: int, level: int, text: str, name: str, kinds: Collection[EventKind] = ()
) -> bytes:
    """Encode `events`: rcl_interfaces/Log; level 20 info, 30 warn, 40 error; `name` is the
    node's.
    """
    return encode(
        new(
            "rcl_interfaces/Log",
            stamp=time_message(stamp_ns),
            level=level,
            name=name,
            msg=text,
            function=" ".join(sorted(kinds)),
        )
    )


def event_kinds(event: Log) -> frozenset[str]:
    """Return the kinds of an event, see EventKind."""
    return frozenset(event.function.split())
