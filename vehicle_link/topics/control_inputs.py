"""Messages that steer the vehicle and keep its link alive: sticks, external references,
heartbeats."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from quadrotor.errors import MeasurementError
from quadrotor.records import REFERENCE, Record
from vehicle_link.messages import decode, stamp_of
from vehicle_link.messages.cdr_layout import FixedLayout
from vehicle_link.topics.ticks import WORLD, set_stamps, xyz

STICK_AXES = ("forward", "left", "up", "yaw")


@dataclass(frozen=True, slots=True)
class Sticks:
    """Axes (forward, left, up, yaw) in -1..1; `enabled` while the dead-man button is held."""

    stamp_ns: int
    axes: tuple[float, float, float, float]
    enabled: bool
    requester: str = ""  # who holds the sticks: the message's frame_id


@cache
def _sticks_layout() -> FixedLayout:
    return FixedLayout("sensor_msgs/Joy", lengths={"axes": len(STICK_AXES), "buttons": 1})


def encode_joy(stamp_ns: int, axes: Sequence[float], enabled: bool) -> bytes:
    """Encode `joy` and `stick`: sensor_msgs/Joy; axes forward, left, up, yaw; buttons[0] is the
    dead-man button.
    """
    out = _sticks_layout().new()
    set_stamps(out, stamp_ns)
    out["axes"] = axes
    out["buttons"] = int(enabled)
    return out.tobytes()


def decode_joy(payload: bytes) -> Sticks:
    """Decode sticks; axes are clipped to -1..1.

    Raises:
        LinkError: the bytes are not a Joy.
        MeasurementError: not four finite axes, or no button.
    """
    message = decode(payload, "sensor_msgs/Joy")
    axes = [float(value) for value in message.axes]
    if len(axes) != len(STICK_AXES) or not all(map(math.isfinite, axes)):
        raise MeasurementError(f"sticks need four finite axes {STICK_AXES}, not {axes}")
    if len(message.buttons) < 1:
        raise MeasurementError("sticks need a button 0, held to enable them")
    forward, left, up, yaw = (max(-1.0, min(1.0, value)) for value in axes)
    return Sticks(
        stamp_of(message),
        (forward, left, up, yaw),
        bool(message.buttons[0]),
        str(message.header.frame_id),
    )


def decode_external_reference(payload: bytes) -> tuple[int, Record]:
    """Decode `external_reference`: (stamp in ns, REFERENCE record of shape (1,)).

    Raises:
        LinkError: the bytes are not a Reference.
        MeasurementError: a number is not finite, or the frame is not the world.
    """
    message = decode(payload, "quadlab_msgs/Reference")
    if message.header.frame_id not in ("", WORLD):
        raise MeasurementError(
            f"a reference in the frame {message.header.frame_id!r}; send it in {WORLD!r} (z up)"
        )
    reference = np.zeros(1, REFERENCE)
    for name in ("position", "velocity", "acceleration", "jerk", "snap"):
        reference[f"{name}_w"] = xyz(getattr(message, name))
    for name in ("yaw", "yaw_rate", "yaw_acceleration"):
        reference[name] = getattr(message, name)
    if not np.isfinite(reference.view("f8")).all():
        raise MeasurementError("a reference with a number that is not finite; send zeros instead")
    return stamp_of(message), reference


@cache
def _heartbeat_layout() -> FixedLayout:
    return FixedLayout("quadlab_msgs/Heartbeat")


class Heartbeat(NamedTuple):
    """A heartbeat of one end of the link.

    Attributes:
        instance: of the process that sends it, 0 if unknown.
        holder: instance of the station whose commands the vehicle accepts, 0 for none.
    """

    sequence: int
    stamp_ns: int
    instance: int = 0
    holder: int = 0


def encode_heartbeat(sequence: int, stamp_ns: int, instance: int = 0, holder: int = 0) -> bytes:
    """Encode `vehicle_heartbeat` or `station_heartbeat`: quadlab_msgs/Heartbeat."""
    out = _heartbeat_layout().new()
    out["sequence"] = sequence & 0xFFFF_FFFF
    out["stamp_ns"] = stamp_ns
    out["instance"] = instance
    out["holder"] = holder
    return out.tobytes()


def decode_heartbeat(payload: bytes) -> Heartbeat:
    """Decode a heartbeat. Raises LinkError."""
    record = _heartbeat_layout().decode(payload)
    return Heartbeat(*(int(record[name]) for name in Heartbeat._fields))
