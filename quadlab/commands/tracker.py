"""`quadlab tracker`: connects a laboratory's tracking system to the station."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from quadlab.commands.option_types import File, Folder, optional
from quadlab.data_folder import data_folder
from quadlab.vehicle_names import THE_VEHICLE, check_name
from quadrotor.errors import LinkError, UsageError

if TYPE_CHECKING:
    from console.trackers.camera_view import CameraView
    from console.trackers.source import Source

UDP_PORT = 5005
CAMERAS = ("camera", "onboard_camera")
ANYWHERE, HERE = "0.0.0.0", "127.0.0.1"


@dataclass
class Tracker:
    """Connect a laboratory's tracking system to the station."""

    system: Annotated[
        Literal["vicon", "natnet", "qtm", "vrpn", "ros2", "udp", "camera", "onboard_camera"],
        tyro.conf.Positional,
    ]
    """the tracking system; udp receives lines stamp,name,x,y,z,qw,qx,qy,qz; onboard_camera measures
    bearings to tags or LEDs that serve as beacons, which replace the emulated ones"""
    body: Annotated[
        tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="[VEHICLE=]NAME")
    ] = ()
    """the body's name in the system, with ros2 its topic (default: the vehicle's name); repeat it
    for several vehicles; with onboard_camera, the vehicle that carries the camera"""
    host: str = ""
    """address of the system; with udp, the address to listen on"""
    port: Annotated[int | None, optional("PORT")] = None
    """port, if it is not the system's usual one (udp: 5005)"""
    unit: Literal["m", "mm"] = "m"
    """unit of the positions that the system sends"""
    up: Literal["z", "y"] = "z"
    """axis of the system that points up"""
    device: int = 0
    """camera and onboard_camera: number of the camera, as in /dev/video0"""
    video: File = None
    """camera and onboard_camera: read this video file instead of a camera"""
    intrinsics: File = None
    """camera and onboard_camera: file of the camera's intrinsics (default: those accepted on the
    Set-up page, or by `quadlab camera`, in the data folder)"""
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

    def check(self) -> dict[str, str]:
        """Return the body of each vehicle. Raises UsageError for inconsistent options."""
        bodies = {} if self.of_bearings else parse_bodies(self.body)
        if self.port is not None and not 1 <= self.port <= 65535:
            raise UsageError(f"--port {self.port} is out of range (1 to 65535)")
        if self.system == "ros2" and not all(name.startswith("/") for name in bodies.values()):
            raise UsageError(
                "with ros2, --body is a topic with its leading slash, like --body /vrpn/cf7/pose"
            )
        if self.system in CAMERAS and self.tags is None:
            raise UsageError(f"{self.system} needs --tags FILE; see docs/trackers.md")
        if self.system in CAMERAS and self.intrinsics is None and self.video is not None:
            raise UsageError("--video needs --intrinsics FILE: a video is no camera that is known")
        if self.of_bearings:
            if len(self.body) > 1 or any("=" in word for word in self.body):
                raise UsageError(
                    "onboard_camera is on one vehicle: name it, like --body quad1, and start one "
                    "command for each camera"
                )
            bodies = {name: name for name in self.body or (THE_VEHICLE,)}
            check_name(next(iter(bodies)))
        from console.trackers.motion_capture import SYSTEMS, check_library

        if self.system in SYSTEMS:
            check_library(self.system)
        return bodies

    def run(self) -> int:
        bodies = self.check()
        from console.trackers.camera_view import CameraView
        from console.trackers.motion_capture import SYSTEMS
        from console.trackers.onboard_camera import BearingsTracker
        from console.trackers.process import Tracker as Poses
        from vehicle_link import clock
        from vehicle_link.lockstep import page_at
        from vehicle_link.termination_signal import EndSignal
        from vehicle_link.transport.session import loopback_session

        stopping = EndSignal()
        host = self.host or (ANYWHERE if self.system == "udp" else HERE)
        usual = SYSTEMS[self.system][1] if self.system in SYSTEMS else UDP_PORT
        port = usual if self.port is None else self.port
        where = f" at {host}:{port}"
        if self.system == "ros2":
            where = ""
        elif self.system in CAMERAS:
            where = f" {self.device if self.video is None else self.video}"
        session, is_reported = None, False
        while session is None:
            try:
                session = loopback_session(self.loopback_port)
            except LinkError as error:
                if not is_reported:
                    print(f"tracker: {error}; trying again", flush=True)
                is_reported = True
                if stopping.wait(1.0):
                    return 0
        if clock.page() is None:
            clock.follow(page_at(self.loopback_port))
        print(f"tracker: {self.system}{where}, for {', '.join(bodies)}", flush=True)
        kind = BearingsTracker if self.of_bearings else Poses
        view = CameraView() if self.system in CAMERAS else None
        kind(
            f"{self.system}{where}",
            lambda: self._source(host, port, session, list(bodies.values()), view),
            bodies,
            session,
            self.unit,
            self.up,
            view,
        ).run(stopping)
        session.close()
        return 0

    def _source(
        self, host: str, port: int, session: Any, bodies: Sequence[str], view: CameraView | None
    ) -> Source:
        """Connect to the system. Raises QuadlabError."""
        if self.system == "udp":
            from console.trackers.udp import UdpSource

            return UdpSource(host, port)
        if self.system == "ros2":
            from console.trackers.ros2 import Ros2Source

            return Ros2Source(session, bodies)
        if self.system in CAMERAS:
            assert self.tags is not None
            from console.trackers.camera import CameraSource
            from console.trackers.camera_store import CameraStore
            from console.trackers.onboard_camera import OnboardCameraSource, StationBeacons

            camera = self.device if self.video is None else self.video
            intrinsics = self.intrinsics or CameraStore(data_folder(self.data)).path(self.device)
            if not self.of_bearings:
                return CameraSource(camera, intrinsics, self.tags, view)
            beacons = StationBeacons(session, bodies[0])
            return OnboardCameraSource(camera, intrinsics, self.tags, beacons, view)
        from console.trackers.motion_capture import MotionCaptureSource

        return MotionCaptureSource(self.system, host, port)


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
