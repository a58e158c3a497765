"""The station's subscriptions to its vehicle: each message is handled, then recorded."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from functools import partial

from console.checks.observed import Observed
from console.context import StationContext
from console.link.lane import VehicleLane
from quadrotor.errors import LinkError, MeasurementError
from vehicle_link.topics.table import SHARED, TOPICS
from vehicle_link.transport.publisher import Received

RECORDED_AS_RECEIVED = tuple(
    name for name, row in TOPICS.items() if row.recorded and row.sender != "station"
)
"""Topics recorded as received, including our own parameter changes and events."""

FREQUENT = 50.0
"""Rate in Hz from which a topic of which only the newest messages count has its own thread."""
Handler = Callable[[Received], None]


class Subscriptions:
    """The station's subscriptions; their threads are those of vehicle_link.transport.node.

    Args:
        handlers: handlers by topic; may raise LinkError or MeasurementError for invalid content.
        host: of the vehicle, for datagrams next to the link; empty for none.
        closing: set when errors no longer raise alarms.
    """

    def __init__(
        self,
        context: StationContext,
        host: str,
        observed: Observed,
        handlers: Mapping[str, Handler],
        closing: threading.Event,
    ) -> None:
        self._vehicle, self._link = context.vehicle, context.link
        self._alarms, self._recorder = context.alarms, context.recorder
        self._observed, self._closing = observed, closing
        self._node = context.node
        self._callbacks = callbacks = {
            name: partial(self._received, name, handlers.get(name))
            for name in {*handlers, *RECORDED_AS_RECEIVED}
        }
        self._lane = VehicleLane(
            context.node,
            host,
            context.link,
            callbacks.pop("telemetry"),
            callbacks.pop("vehicle_heartbeat"),
        )
        self.send_heartbeat = self._lane.send_heartbeat

    def begin(self) -> None:
        """Receive messages from now on, and deliver earlier messages of the lane."""
        for name, callback in self._callbacks.items():
            self._node.subscribe(
                name,
                TOPICS[name].type_name,
                callback,
                qos=TOPICS[name].qos,
                newest=TOPICS[name].newest,
                frequent=TOPICS[name].rate >= FREQUENT,
            )

    def close(self) -> None:
        """Close the lane; the others close with their node."""
        self._lane.close()

    def _received(self, name: str, handler: Handler | None, received: Received) -> None:
        """Handle a message; an invalid one raises an alarm until the next valid one."""
        if handler is not None:
            try:
                handler(received)
                self._alarms.set(name, None)
            except (LinkError, MeasurementError) as error:
                if not self._closing.is_set():
                    self._alarms.set(name, f"{name}: {error}")
        if name in RECORDED_AS_RECEIVED:
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
