"""Conversion of telemetry to the standard topics: all samples recorded, the last published."""

from __future__ import annotations

from collections.abc import Callable, Collection

from console.runs.recorder import Message
from quadrotor.records import Record
from vehicle_link import topics
from vehicle_link.messages.cdr_layout import Records, payloads_of
from vehicle_link.topics import TOPICS

ENCODERS: dict[str, Callable[[Record, str], Records]] = {
    "state": topics.state_messages,
    "reference": lambda ticks, vehicle: topics.reference_messages(ticks),
    "imu": topics.imu_messages,
    "actuators": topics.actuator_messages,
}
"""Topic → function that returns its messages for TICK records, shape (N,)."""


def expanded(
    ticks: Record, vehicle: str, wanted: Collection[str] = tuple(ENCODERS)
) -> dict[str, list[bytes]]:
    """Return the payloads of the requested topics, one for each of the TICK records (N,)."""
    return {topic: payloads_of(ENCODERS[topic](ticks, vehicle)) for topic in wanted}


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
