"""Bearings to tags or LEDs from a camera on the vehicle.

The station provides the beacons' positions: a picture that does not fit them is marked as doubtful
but still sent, so that they can be surveyed.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from bearing_sim.beacons import parse_layout
from console.beacon_layout import STATION_LAYOUT
from console.trackers.source import Frame
from extensions.vision.tags.beacon_markers import load_beacon_markers
from extensions.vision.tags.detector import Picture, Tags
from extensions.vision.tags.intrinsics import load_intrinsics
from extensions.vision.tags.led_bearings import bearing_reader
from extensions.vision.tags.tag_bearings import Places
from extensions.vision.tracker.camera import Pictures, TagSource
from extensions.vision.tracker.camera_view import CameraView
from quadrotor.plain_rotations import Array
from vehicle_link.clock import time_ns
from vehicle_link.messages import decode
from vehicle_link.parameters.messages import decode_change
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.parameter_service import ParameterClient
from vehicle_link.transport.publisher import Received

if TYPE_CHECKING:
    from vehicle_link.transport.loopback import Session
FAR_OFF = 3.0
"""Largest deviation of beacons from their positions, pixels rms."""
RECENT_NS = 1_000_000_000
"""Age in ns beyond which the vehicle's estimated position is ignored."""


class Beacons(Protocol):
    """A source of the positions of beacons and vehicle."""

    @property
    def places(self) -> Places: ...

    @property
    def position_w(self) -> Array | None: ...

    def close(self) -> None: ...


class StationBeacons:
    """The beacons' positions, requested from the station, and the vehicle's estimated one. Raises
    LinkError when it does not answer.
    """

    def __init__(self, session: Session, vehicle: str) -> None:
        self._node = Node(session, f"/{vehicle}", "onboard_camera_beacons")
        self._node.subscribe(
            "parameter_changes", TOPICS["parameter_changes"].type_name, self._changed
        )
        self._state: Received | None = None
        self._node.subscribe("state", TOPICS["state"].type_name, self._estimated)
        asked = ParameterClient(self._node, f"/{vehicle}/station")
        self._set(str(asked.values()[STATION_LAYOUT]))

    @property
    def position_w(self) -> Array | None:
        """Return the vehicle's estimated position (3,) m, None without a recent one."""
        state = self._state
        if state is None or time_ns() - state.received_ns > RECENT_NS:
            return None
        at = decode(state.payload, TOPICS["state"].type_name).pose.pose.position
        return np.array((at.x, at.y, at.z))

    def close(self) -> None:
        self._node.close()

    def _estimated(self, received: Received) -> None:
        self._state = received

    def _changed(self, received: Received) -> None:
        change = decode_change(received.payload)
        if change.name == STATION_LAYOUT:
            self._set(str(change.new))

    def _set(self, text: str) -> None:
        beacons = parse_layout(text)
        self.places: Places = dict(
            zip(beacons.ids.tolist(), beacons.positions_w.tolist(), strict=True)
        )


class OnboardCameraSource(TagSource):
    """Beacons in the pictures of a camera, or a video file.

    Args:
        camera, intrinsics, tags, view: as for `extensions.vision.tracker.camera.CameraSource`;
            the tags are read by `extensions.vision.tags.beacon_markers`.
        beacons: closed with the source.

    Raises StorageError, MeasurementError, UnreachableError.
    """

    def __init__(
        self,
        camera: int | Path,
        intrinsics: Path,
        tags: Path,
        beacons: Beacons,
        view: CameraView | None = None,
    ) -> None:
        lens, layout = load_intrinsics(intrinsics), load_beacon_markers(tags)
        self._reader, self._beacons = bearing_reader(layout, lens), beacons
        self._left = math.nan
        super().__init__(Pictures(camera, lens), view or CameraView(), round(1e9 * layout.delay))

    def _read(self, grey: Picture, taken_ns: int) -> Frame:
        self._left = math.nan
        beacons = self._beacons
        seen = self._reader.take(grey, taken_ns, beacons.places, beacons.position_w)
        self._left = self._reader.misfit(seen, self._beacons.places)
        doubt = (
            f"beacons are {self._left:.0f} pixels from their places in the layout, allowed "
            f"{FAR_OFF:g}: survey them (Beacons tab), or calibrate the camera in Settings"
            if self._left > FAR_OFF
            else self._reader.doubt
        )
        return Frame(None, 0, beacons=seen, doubt=doubt)

    def _seen(self) -> tuple[Tags, Collection[int], float]:
        return self._reader.tags, self._beacons.places.keys(), self._left

    def close(self) -> None:
        super().close()
        self._beacons.close()
