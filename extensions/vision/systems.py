"""Cameras as tracking systems: around the room for poses, or on the vehicle for bearings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from console.trackers.source import Connection, Source
from extensions.vision.options import CameraOptions
from extensions.vision.simulated.rendered_pictures import rendered_cameras
from extensions.vision.tags.tag_layout import name_of
from extensions.vision.tracker.camera import CameraSource
from extensions.vision.tracker.camera_store import CameraStore
from extensions.vision.tracker.camera_view import CameraView
from extensions.vision.tracker.onboard_camera import OnboardCameraSource, StationBeacons
from extensions.vision.tracker.several_cameras import open_cameras
from quadrotor.errors import UsageError
from vehicle_link.topics.table import TRACKER_PICTURES


class _Cameras:
    """Cameras that are named by options (`console.trackers.source.System` and `HasViews`)."""

    name: str
    most: int

    def __init__(self, options: CameraOptions) -> None:
        self._options = options
        one = options
        self._cameras: Sequence[int | Path] = tuple(range(one.rendered)) or one.video or one.device
        names = [name_of(camera) for camera in self._cameras]
        self.where = " ".join([*(["rendered"] * bool(one.rendered)), *map(str, self._cameras)])
        self.views: Sequence[CameraView] = [
            CameraView(name if len(names) > 1 else "") for name in names
        ]

    def check(self, bodies: Mapping[str, str]) -> None:
        """Raise UsageError for options that do not go together."""
        options, cameras = self._options, self._cameras
        if not options.rendered and options.tags is None:
            raise UsageError(f"{self.name} needs --tags FILE; see docs/trackers.md")
        if options.video and not options.intrinsics:
            raise UsageError("--video needs --intrinsics FILE: the camera of a video is not known")
        if not 1 <= len(cameras) <= self.most:
            raise UsageError(
                f"{len(cameras)} cameras; {self.name} reads at most {self.most}: start it with "
                "fewer"
            )
        if options.rendered:
            self._check_rendered(bodies)
            return
        if options.intrinsics and len(options.intrinsics) != len(cameras):
            raise UsageError(
                f"--intrinsics has {len(options.intrinsics)} files, but there are {len(cameras)} "
                f"cameras ({', '.join(map(str, cameras))}): give one file for each, in their order"
            )
        names = [name_of(one) for one in cameras]
        if twice := [name for name in names if names.count(name) > 1]:
            raise UsageError(
                f"camera {twice[0]} is given twice: give each camera once, and videos different "
                "file names"
            )

    def _check_rendered(self, bodies: Mapping[str, str]) -> None:
        """Raise UsageError if the cameras cannot be rendered."""
        count = self._options.rendered
        if count < 0 or self.name != OutsideCameras.name or len(bodies) > 1:
            raise UsageError(
                f"--rendered {count} with {self.name}: the system camera renders 1 to "
                f"{OutsideCameras.most} cameras, and one vehicle"
            )

    def _lenses(self, data: Path) -> Sequence[Path]:
        """Return the files of the intrinsics, by default those accepted for each camera."""
        store = CameraStore(data)
        return self._options.intrinsics or [store.path(one) for one in self._options.device]


class OutsideCameras(_Cameras):
    """Cameras around the room that see tags on the vehicles."""

    name, most = "camera", len(TRACKER_PICTURES)

    def open(self, connection: Connection) -> Source:
        if self._options.rendered:
            vehicle, body = next(iter(connection.bodies.items()))
            names = [str(one) for one in self._cameras]
            return rendered_cameras(connection.session, vehicle, body, names, self.views)
        tags, cameras = self._options.tags, self._cameras
        assert tags is not None
        openers = [
            partial(CameraSource.open, camera, lens, tags, view, is_alone=len(cameras) == 1)
            for camera, lens, view in zip(
                cameras, self._lenses(connection.data), self.views, strict=True
            )
        ]
        return open_cameras(openers, [view.name for view in self.views])


class OnboardCamera(_Cameras):
    """A camera on the vehicle that sees beacons: tags, or LEDs that blink."""

    name, most = "onboard_camera", 1

    def open(self, connection: Connection) -> Source:
        assert self._options.tags is not None
        beacons = StationBeacons(connection.session, next(iter(connection.bodies)))
        [camera], [lens], [view] = self._cameras, self._lenses(connection.data), self.views
        return OnboardCameraSource(camera, lens, self._options.tags, beacons, view)
