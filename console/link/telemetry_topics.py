"""Conversion of telemetry to the standard topics: all samples recorded, the last published."""

from __future__ import annotations

from collections.abc import Callable, Collection

from console.runs.recorder import Message
from quadrotor.records import Record
from vehicle_link.topics import (
    TOPICS,
    encode_actuators,
    encode_imus,
    encode_references,
    encode_states,
)

ENCODERS: dict[str, Callable[[Record, str], list[bytes]]] = {
    "state": encode_states,
    "reference": lambda ticks, vehicle: encode_references(ticks),
    "imu": encode_imus,
    "actuators": encode_actuators,
}
"""Topic → function that returns its payloads for TICK records, shape (N,)."""


def expanded(
    ticks: Record, vehicle: str, wanted: Collection[str] = tuple(ENCODERS)
) -> dict[str, list[bytes]]:
    """Return the payloads of the requested topics, one for each of the TICK records (N,)."""
    return {topic: ENCODERS[topic](ticks, vehicle) for topic in wanted}


def messages_of(
    payloads: dict[str, list[bytes]], ticks: Record, vehicle: str, received_ns: int
) -> list[Message]:
    """Return the messages for the recorder: received now, published at each sample's own stamp."""
    stamps = ticks["imu"]["stamp_ns"].tolist()
    return [
        (f"/{vehicle}/{topic}", TOPICS[topic].type_name, payload, received_ns, stamp)
        for topic, column in payloads.items()
        for payload, stamp in zip(column, stamps, strict=True)
    ]
