"""The station's subscriptions to its vehicle: each message is handled, then recorded."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from functools import partial

from console.checks.alarms import AlarmBoard
from console.checks.observed import Observed
from console.link.lane import LaneIn
from console.link.monitor import LinkMonitor
from console.runs.recorder import Recorder
from quadrotor.errors import LinkError, MeasurementError
from vehicle_link.topics import TOPICS
from vehicle_link.topics.table import SHARED
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Publisher, Received

AS_IT_COMES = tuple(
    name for name, row in TOPICS.items() if row.recorded and row.sender != "station"
)
"""Topics recorded as received, including our own parameter changes and events."""

Act = Callable[[Received], None]


class Subscriptions:
    """The station's subscriptions; each topic has its own thread (vehicle_link.transport.node).

    Args:
        acts: handlers by topic; may raise LinkError or MeasurementError for invalid content.
        host: of the vehicle, for datagrams next to the link; empty for none.
        beats: publishes our heartbeats.
        closing: set when errors no longer raise alarms.
    """

    def __init__(
        self,
        node: Node,
        vehicle: str,
        host: str,
        link: LinkMonitor,
        alarms: AlarmBoard,
        observed: Observed,
        recorder: Recorder,
        acts: Mapping[str, Act],
        beats: Publisher,
        closing: threading.Event,
    ) -> None:
        self._vehicle = vehicle
        self._link, self._alarms = link, alarms
        self._observed, self._recorder = observed, recorder
        self._closing = closing
        callbacks = {
            name: partial(self._received, name, acts.get(name)) for name in {*acts, *AS_IT_COMES}
        }
        self._lane = LaneIn(
            node, host, link, callbacks.pop("telemetry"), callbacks.pop("vehicle_heartbeat"), beats
        )
        for name, callback in callbacks.items():
            node.subscribe(
                name,
                TOPICS[name].type_name,
                callback,
                qos=TOPICS[name].qos,
                newest=TOPICS[name].newest,
            )

    def close(self) -> None:
        """Close the lane; the others close with their node."""
        self._lane.close()

    def _received(self, name: str, act: Act | None, received: Received) -> None:
        """Handle a message; an invalid one raises an alarm until the next valid one."""
        if act is not None:
            try:
                act(received)
                self._alarms.set(name, None)
            except (LinkError, MeasurementError) as error:
                if not self._closing.is_set():
                    self._alarms.set(name, f"{name}: {error}")
        if name in AS_IT_COMES:
            if TOPICS[name].sender == "vehicle" and name not in SHARED:
                self._link.note_session_message()
            self._observed.message(name, received.payload)
            self._recorder.put(
                f"/{self._vehicle}/{name}",
                TOPICS[name].type_name,
                received.payload,
                received.received_ns,
                received.source_ns,
            )
