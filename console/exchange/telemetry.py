"""Reception of telemetry packets: every sample is recorded and passed to the page, the newest one
distributed as messages.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

from console.checks.observed import Observed
from console.context import StationContext
from console.experiment_running.runner import ExperimentRunner
from console.link.outbox import TICKS
from console.part import Part
from console.runs.recorder import Message
from quadrotor.records import Record
from vehicle_link.clock import time_ns
from vehicle_link.messages.cdr_layout import payloads_of
from vehicle_link.telemetry import unpack
from vehicle_link.topics.rmw_keys import full_name
from vehicle_link.topics.scene import SCENE_TOPICS, SceneMessages
from vehicle_link.topics.table import TOPICS
from vehicle_link.topics.ticks import TICK_TOPICS
from vehicle_link.transport.publisher import Received


class TelemetryReception:
    """Receives telemetry; used by one thread. `on_stamp` is called with the newest stamp of each
    packet.
    """

    def __init__(
        self,
        context: StationContext,
        parts: Part,
        observed: Observed,
        experiments: ExperimentRunner,
        on_stamp: Callable[[int], None],
    ) -> None:
        self._vehicle, self._link = context.vehicle, context.link
        self._outbox, self._recorder = context.outbox, context.recorder
        self._parts, self._observed = parts, observed
        self._experiments, self._newest = experiments, on_stamp
        self._scene = SceneMessages(context.vehicle)

    def received(self, received: Received) -> None:
        """Handle a packet of telemetry. Raises LinkError when it is invalid."""
        sequence, ticks = unpack(received.payload)
        stamp_ns = int(ticks["imu"]["stamp_ns"][-1])
        shown = self._link.telemetry(sequence, stamp_ns, received.received_ns, time_ns())
        self._parts.telemetry(received.payload)
        self._experiments.readings.telemetry(sequence, ticks)
        if shown:
            self._observed.telemetry(ticks[-1])
            self._experiments.feed.telemetry(stamp_ns, ticks["state"]["position_w"][-1])
        self._outbox.put(TICKS, received.payload, stamp_ns if shown else 0)
        payloads: dict[str, list[bytes]] = {}
        if self._recorder.run_id:
            payloads = expanded(ticks, self._vehicle)
            messages = messages_of(payloads, ticks, self._vehicle, received.received_ns)
            self._recorder.put_all(messages)
        elif shown:
            payloads = expanded(
                ticks[-1:], self._vehicle, self._outbox.subscribed_topics & TICK_TOPICS.keys()
            )
        if shown:
            for name in self._outbox.subscribed_topics & payloads.keys():
                self._outbox.put(name, payloads[name][-1], stamp_ns)
            if self._recorder.run_id or not self._outbox.subscribed_topics.isdisjoint(SCENE_TOPICS):
                self._draw(ticks, received.received_ns)
        self._newest(stamp_ns)

    def _draw(self, ticks: Record, received_ns: int) -> None:
        """Record and publish what 3D panels show."""
        for name, payload, stamp_ns in self._scene.of(ticks):
            topic = full_name(f"/{self._vehicle}", name)
            kind = TOPICS[name].type_name
            self._recorder.put(topic, kind, payload, received_ns, stamp_ns)
            if name in self._outbox.subscribed_topics:
                self._outbox.put(name, payload, stamp_ns)


def expanded(
    ticks: Record, vehicle: str, wanted: Collection[str] = tuple(TICK_TOPICS)
) -> dict[str, list[bytes]]:
    """Return the payloads of the requested topics, one for each of the TICK records (N,)."""
    return {topic: payloads_of(TICK_TOPICS[topic](ticks, vehicle)) for topic in wanted}


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
