"""`quadlab tracker`: connects a laboratory's tracking system to the station."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from quadlab.data_folder import data_folder
from quadlab.option_types import File, Files, Folder, optional
from quadlab.vehicle_names import THE_VEHICLE, check_name
from quadrotor.errors import UsageError
from quadrotor.extension import TrackingSystem
from quadrotor.extensions import registry

if TYPE_CHECKING:
    from console.trackers.camera_view import CameraView
    from console.trackers.source import Connection, Source, System

CAMERAS = ("camera", "onboard_camera")
HERE = "127.0.0.1"
SYSTEMS = registry().offers(TrackingSystem, taken=CAMERAS)
"""The tracking systems of extensions, by name."""
if TYPE_CHECKING:
    SystemName = str
else:
    SystemName = Literal[*SYSTEMS, *CAMERAS]


@dataclass
class Tracker:
    """Connect a laboratory's tracking system to the station."""

    system: Annotated[SystemName, tyro.conf.Positional]
    """the tracking system; udp receives lines stamp,name,x,y,z,qw,qx,qy,qz; onboard_camera measures
    bearings to tags or LEDs that serve as beacons, which replace the emulated ones"""
    body: Annotated[
        tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="[VEHICLE=]NAME")
    ] = ()
    """the body's name in the system, with ros2 its topic (default: the vehicle's name); repeat it
    for several vehicles; with onboard_camera, the vehicle that carries the camera"""
    host: str = ""
    """address of the system; with udp, the address to listen on (default: this computer only; for
    everybody in the network 0.0.0.0)"""
    port: Annotated[int | None, optional("PORT")] = None
    """port, if it is not the system's usual one (udp: 5005)"""
    unit: Literal["m", "mm"] = "m"
    """unit of the positions that the system sends"""
    up: Literal["z", "y"] = "z"
    """axis of the system that points up"""
    device: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N [N …]")] = (0,)
    """camera and onboard_camera: number of the camera, as in /dev/video0; up to four with
    camera"""
    video: Files = ()
    """camera and onboard_camera: read these video files instead of cameras"""
    rendered: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """camera: render the simulated vehicle as N cameras around the room see it, instead of reading
    cameras"""
    intrinsics: Files = ()
    """camera and onboard_camera: file of the intrinsics of each camera, in their order (default:
    those accepted on the Settings page, or by `quadlab camera`, in the data folder)"""
    tags: File = None
    """camera and onboard_camera: TOML file with the tags and their places, or with the LEDs and how
    often they blink"""
    loopback_port: int = 7447
    """TCP port of the station's session on loopback"""
    data: Folder = None
    """data folder, for intrinsics"""

    @property
    def of_bearings(self) -> bool:
        """Return whether it provides bearings instead of poses."""
        return self.system == CAMERAS[1]

    @property
    def cameras(self) -> Sequence[int | Path]:
        """Return the cameras, or what is read instead: video files, or numbers of rendered ones."""
        return tuple(range(self.rendered)) or self.video or self.device

    def check(self) -> dict[str, str]:
        """Return the body of each vehicle. Raises UsageError for inconsistent options."""
        bodies = {} if self.of_bearings else parse_bodies(self.body)
        if self.port is not None and not 1 <= self.port <= 65535:
            raise UsageError(f"--port {self.port} is out of range (1 to 65535)")
        if self.system in CAMERAS:
            self._check_cameras()
        if self.of_bearings:
            if len(self.body) > 1 or any("=" in word for word in self.body):
                raise UsageError(
                    "onboard_camera is on one vehicle: name it, like --body quad1, and start one "
                    "command for each camera"
                )
            bodies = {name: name for name in self.body or (THE_VEHICLE,)}
            check_name(next(iter(bodies)))
        if self.system in SYSTEMS:
            self._check_library()
            system: System = SYSTEMS[self.system].load()
            system.check(bodies)
        return bodies

    def _check_library(self) -> None:
        """Raise UsageError unless the library that the system needs is installed."""
        offered = SYSTEMS[self.system]
        library, extension = offered.offer.library, offered.extension
        assert extension is not None
        if library and importlib.util.find_spec(library) is None:
            raise UsageError(
                f"{self.system} needs the package {library}; install it with "
                f"{extension.libraries.get(library, f'pip install {library}')}, or choose another "
                "system"
            )

    def _check_cameras(self) -> None:
        from console.trackers.source import name_of
        from vehicle_link.topics import TRACKER_PICTURES

        cameras, most = self.cameras, 1 if self.of_bearings else len(TRACKER_PICTURES)
        if not self.rendered and self.tags is None:
            raise UsageError(f"{self.system} needs --tags FILE; see docs/trackers.md")
        if self.video and not self.intrinsics:
            raise UsageError("--video needs --intrinsics FILE: the camera of a video is not known")
        if not 1 <= len(cameras) <= most:
            raise UsageError(
                f"{len(cameras)} cameras; {self.system} reads at most {most}: start it with fewer"
            )
        if self.rendered < 0 or (self.rendered and (self.of_bearings or len(self.body) > 1)):
            raise UsageError(
                f"--rendered {self.rendered} with {self.system}: the system camera renders 1 to "
                f"{len(TRACKER_PICTURES)} cameras, and one vehicle"
            )
        if self.rendered:
            return
        if self.intrinsics and len(self.intrinsics) != len(cameras):
            raise UsageError(
                f"--intrinsics has {len(self.intrinsics)} files, but there are {len(cameras)} "
                f"cameras ({', '.join(map(str, cameras))}): give one file for each, in their order"
            )
        names = [name_of(one) for one in cameras]
        if twice := [name for name in names if names.count(name) > 1]:
            raise UsageError(
                f"camera {twice[0]} is given twice: give each camera once, and videos different "
                "file names"
            )

    def run(self) -> int:
        bodies = self.check()
        from console.trackers.camera_view import CameraView
        from console.trackers.onboard_camera import BearingsTracker
        from console.trackers.process import Tracker as Poses
        from console.trackers.source import Connection, name_of
        from quadlab.station_client import await_session
        from vehicle_link.defects import end_at_defect
        from vehicle_link.termination_signal import EndSignal

        end_at_defect()
        stopping = EndSignal()
        host = self.host or HERE
        usual = SYSTEMS[self.system].offer.port if self.system in SYSTEMS else 0
        port = usual if self.port is None else self.port
        where = f" at {host}:{port}" if port else ""
        if self.system in CAMERAS:
            where = f"{' rendered' * bool(self.rendered)} {' '.join(map(str, self.cameras))}"
        session = await_session(
            self.loopback_port, stopping, lambda line: print(f"tracker: {line}", flush=True)
        )
        if session is None:
            return 0
        print(f"tracker: {self.system}{where}, for {', '.join(bodies)}", flush=True)
        kind = BearingsTracker if self.of_bearings else Poses
        names = [name_of(one) for one in self.cameras] if self.system in CAMERAS else []
        views = [CameraView(name if len(names) > 1 else "") for name in names]
        kind(
            f"{self.system}{where}",
            lambda: self._source(Connection(host, port, session, bodies), views),
            bodies,
            session,
            self.unit,
            self.up,
            views,
        ).run(stopping)
        session.close()
        return 0

    def _source(self, to: Connection, views: Sequence[CameraView]) -> Source:
        """Connect to the system. Raises QuadlabError."""
        if self.system in CAMERAS:
            if self.rendered:
                from quadlab.simulated.rendered_pictures import rendered_cameras

                vehicle, body = next(iter(to.bodies.items()))
                names = [str(one) for one in self.cameras]
                return rendered_cameras(to.session, vehicle, body, names, views)
            assert self.tags is not None
            from console.trackers.camera import CameraSource
            from console.trackers.camera_store import CameraStore
            from console.trackers.onboard_camera import OnboardCameraSource, StationBeacons
            from console.trackers.several_cameras import open_cameras

            cameras, alone = self.cameras, len(self.cameras) == 1
            store = CameraStore(data_folder(self.data))
            lenses = self.intrinsics or [store.path(one) for one in self.device]
            if self.of_bearings:
                beacons = StationBeacons(to.session, next(iter(to.bodies)))
                [camera], [lens], [view] = cameras, lenses, views
                return OnboardCameraSource(camera, lens, self.tags, beacons, view)
            openers = [
                partial(CameraSource.open, camera, lens, self.tags, view, is_alone=alone)
                for camera, lens, view in zip(cameras, lenses, views, strict=True)
            ]
            return open_cameras(openers, [view.name for view in views])
        system: System = SYSTEMS[self.system].load()
        return system.open(to)


def parse_bodies(words: Sequence[str]) -> dict[str, str]:
    """Return `vehicle=body` words as {vehicle: body}. Raises UsageError."""
    found: dict[str, str] = {}
    for word in words or (THE_VEHICLE,):
        vehicle, equals, body = word.partition("=")
        if not equals:
            vehicle, body = THE_VEHICLE, word
        check_name(vehicle)
        if vehicle in found or body in found.values():
            raise UsageError(
                f"--body {word} names a vehicle or a body twice; give each vehicle a body "
                "of its own, like --body quad1=cf7 --body quad2=cf8"
            )
        if not body:
            raise UsageError(f"--body {word} names no body; write it like --body {vehicle}=cf7")
        found[vehicle] = body
    return found
