"""Poses from ROS 2 nodes: topics of geometry_msgs/PoseStamped, each for the body of its name.

They arrive through the station's router, like everything from ROS 2 (docs/ros2.md).
"""

from __future__ import annotations

import queue
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

from console.trackers.source import Body, Connection, Frame
from quadrotor.errors import LinkError, MeasurementError, UsageError
from vehicle_link.clock import monotonic_ns
from vehicle_link.topics.measurements import decode_pose
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received

if TYPE_CHECKING:
    from vehicle_link.transport.loopback import Session
KEPT = 64


class Ros2Source:
    """Poses published by ROS 2 nodes.

    Args:
        session: with the station.
        names: of the topics, with their leading slash.
    """

    def __init__(self, session: Session, names: Sequence[str]) -> None:
        self._node = Node(session, "", "quadlab_tracker")
        self._items: queue.Queue[tuple[str, bytes, int] | None] = queue.Queue(KEPT)
        for name in names:
            self._node.subscribe(name, "geometry_msgs/PoseStamped", partial(self._put, name))

    def frames(self) -> Iterator[Frame]:
        """Yield one frame of one body per message. Raises MeasurementError."""
        while item := self._items.get():
            name, payload, received_ns = item
            try:
                sample = decode_pose(payload)[0]
            except LinkError as error:  # of another type: the next may be a pose
                raise MeasurementError(f"{name}: {error}") from None
            body = Body(name, sample["position_w"].copy(), sample["quaternion_wb"].copy())
            yield Frame(int(sample["stamp_ns"]) or None, received_ns, (body,))

    def close(self) -> None:
        self._node.close()
        with suppress(queue.Empty):  # make room for the end marker
            while True:
                self._items.get_nowait()
        self._items.put(None)

    def _put(self, name: str, received: Received) -> None:
        with suppress(queue.Full):  # a pose that has to wait is worthless
            self._items.put_nowait((name, received.payload, monotonic_ns()))


class Ros2:
    """Topics of ROS 2 as a tracking system (`console.trackers.source.System`)."""

    def check(self, bodies: Mapping[str, str]) -> None:
        """Raise UsageError for a name that is no topic."""
        if not all(name.startswith("/") for name in bodies.values()):
            raise UsageError(
                "with ros2, --body is a topic with its leading slash, like --body /vrpn/cf7/pose"
            )

    def open(self, connection: Connection) -> Ros2Source:
        """Return the source, which listens to the topics of the bodies. Raises LinkError."""
        return Ros2Source(connection.session, list(connection.bodies.values()))


SYSTEM = Ros2()
