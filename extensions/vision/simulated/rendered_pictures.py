"""Pictures of the simulated vehicle as cameras around the room see it, in real time."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING

from console.trackers.source import Source
from extensions.vision.simulated.camera_scene import LENS, STANDS, Scene, layout
from extensions.vision.tags.detector import Picture
from extensions.vision.tags.tag_layout import CameraPlace
from extensions.vision.tags.tag_tracker import TagTracker
from extensions.vision.tracker.camera import CameraSource
from extensions.vision.tracker.camera_view import CameraView
from extensions.vision.tracker.several_cameras import open_cameras
from quadrotor.errors import UnreachableError
from quadrotor.rotations import quaternion_to_matrix
from vehicle_link.clock import monotonic_ns, time_ns
from vehicle_link.topics.table import TOPICS
from vehicle_link.topics.ticks import decode_odometry
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received

if TYPE_CHECKING:
    from vehicle_link.transport.loopback import Session
PERIOD = 0.066
"""Seconds between two pictures of a camera, if the computer is quick enough."""
SILENT = 2.0
"""Seconds without a true pose after which the camera counts as unplugged."""


class RenderedPictures:
    """Renders the true poses that the simulator publishes; a `PictureStream`.

    Args:
        session: with the station.
        vehicle: whose truth it is.
        stand: place of the camera.
        number: of the camera, for messages and its noise.
    """

    def __init__(self, session: Session, vehicle: str, stand: CameraPlace, number: int) -> None:
        self._stand, self._scene, self._number = stand, Scene(number), number
        self._newest: Received | None = None
        self._came, self._closed = threading.Event(), threading.Event()
        self._node = Node(session, f"/{vehicle}", f"rendered_camera_{number}")
        truth = TOPICS["truth"]
        self._node.subscribe("truth", truth.type_name, self._received, newest=truth.newest)

    def __iter__(self) -> Iterator[tuple[int | None, int, Picture]]:
        while not self._closed.wait(PERIOD):
            self._came.clear()
            if not self._came.wait(SILENT):
                raise UnreachableError(
                    f"camera {self._number} sees no simulated vehicle; start quadlab up"
                )
            received = self._newest
            assert received is not None
            stamp_ns, state = decode_odometry(received.payload)
            arrived_ns = received.received_ns - time_ns() + monotonic_ns()
            R_wb = quaternion_to_matrix(state["quaternion_wb"][0])
            yield (
                stamp_ns,
                arrived_ns,
                self._scene.picture(self._stand, state["position_w"][0], R_wb),
            )

    def close(self) -> None:
        self._closed.set()
        self._node.close()

    def _received(self, received: Received) -> None:
        self._newest = received
        self._came.set()


def rendered_cameras(
    session: Session, vehicle: str, body: str, names: Sequence[str], views: Sequence[CameraView]
) -> Source:
    """Return cameras around the room as one tracking system."""
    places = dict(zip(names, STANDS, strict=False))
    tags, is_alone = layout(body, places), len(names) == 1

    def open_one(number: int) -> CameraSource:
        pictures = RenderedPictures(session, vehicle, STANDS[number], number)
        tracker = TagTracker(tags, LENS, names[number], is_alone=is_alone)
        return CameraSource(pictures, tracker, views[number])

    return open_cameras([partial(open_one, k) for k in range(len(names))], names)
