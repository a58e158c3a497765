"""The cameras' pictures in a run: subscribed only while a run is recorded."""

from __future__ import annotations

from functools import partial

from console.context import StationContext
from vehicle_link.topics.measurements import PICTURE
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received

PICTURES = tuple(name for name, row in TOPICS.items() if row.type_name == PICTURE)
JITTER = 0.9
"""Share of the period after which the next picture is accepted."""


class PictureRecording:
    """Records at most `pictures` a second of each camera. Used by one thread."""

    def __init__(self, context: StationContext) -> None:
        self._session, self._vehicle = context.node.session, context.vehicle
        self._recorder, self._parameters = context.recorder, context.parameters.recorder
        self._node: Node | None = None
        self._last: dict[str, int] = {}

    def tick(self) -> None:
        """Subscribe when a run has begun, and unsubscribe when it has ended: pictures are made only
        while something subscribes. Raises LinkError when the session is closed.
        """
        is_wanted = bool(self._recorder.run_id) and self._parameters.pictures > 0.0
        if is_wanted and self._node is None:
            self._node = Node(self._session, f"/{self._vehicle}", "station_pictures")
            for name in PICTURES:
                take = partial(self._received, name)
                self._node.subscribe(name, PICTURE, take, newest=TOPICS[name].newest)
        elif not is_wanted:
            self.close()

    def close(self) -> None:
        if self._node is not None:
            self._node.close()
            self._node = None

    def _received(self, name: str, received: Received) -> None:
        rate, last = self._parameters.pictures, self._last.get(name)
        passed_ns = 0 if last is None else abs(received.source_ns - last)
        if not rate or (last is not None and passed_ns < JITTER * 1e9 / rate):
            return
        self._last[name] = received.source_ns
        topic = f"/{self._vehicle}/{name}"
        self._recorder.put(
            topic, PICTURE, received.payload, received.received_ns, received.source_ns
        )
