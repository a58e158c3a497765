"""`quadlab tracker`: connects a laboratory's tracking system to the station."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, make_dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from quadlab.data_folder import data_folder
from quadlab.option_types import Folder, optional
from quadlab.vehicle_names import THE_VEHICLE, check_name
from quadrotor.errors import UsageError
from quadrotor.extension import TrackingSystem
from quadrotor.extensions import registry

if TYPE_CHECKING:
    from console.trackers.source import System

HERE = "127.0.0.1"
SYSTEMS = registry().offers(TrackingSystem)
"""The tracking systems of extensions, by name."""
if TYPE_CHECKING:
    SystemName = str
else:
    SystemName = Literal[*SYSTEMS]


@dataclass
class TrackerCommand:
    """Connect a laboratory's tracking system to the station."""

    system: Annotated[SystemName, tyro.conf.Positional]
    """the tracking system; udp receives lines stamp,name,x,y,z,qw,qx,qy,qz"""
    body: Annotated[
        tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="[VEHICLE=]NAME")
    ] = ()
    """the body's name in the system, with ros2 its topic (default: the vehicle's name); repeat it
    for several vehicles; of a system that measures bearings, the vehicle that carries it"""
    host: str = ""
    """address of the system; with udp, the address to listen on (default: this computer only; for
    everybody in the network 0.0.0.0)"""
    port: Annotated[int | None, optional("PORT")] = None
    """port, if it is not the system's usual one (udp: 5005)"""
    unit: Literal["m", "mm"] = "m"
    """unit of the positions that the system sends"""
    up: Literal["z", "y"] = "z"
    """axis of the system that points up"""
    loopback_port: int = 7447
    """TCP port of the station's session on loopback"""
    data: Folder = None
    """data folder, for intrinsics"""

    @property
    def of_bearings(self) -> bool:
        """Return whether it provides bearings instead of poses."""
        return SYSTEMS[self.system].offer.bearings

    def check(self) -> dict[str, str]:
        """Return the body of each vehicle. Raises UsageError for inconsistent options."""
        return self._checked(self._connected())

    def _connected(self) -> System:
        """Return the system, with its options if it has any. Raises UsageError."""
        offered = SYSTEMS[self.system]
        self._check_library()
        target = offered.load()
        system: System = target
        if offered.offer.options:
            kind = offered.load(offered.offer.options)
            system = target(getattr(self, kind.__name__))
        return system

    def _checked(self, system: System) -> dict[str, str]:
        bodies = {} if self.of_bearings else parse_bodies(self.body)
        if self.port is not None and not 1 <= self.port <= 65535:
            raise UsageError(f"--port {self.port} is out of range (1 to 65535)")
        if self.of_bearings:
            if len(self.body) > 1 or any("=" in word for word in self.body):
                raise UsageError(
                    f"{self.system} is on one vehicle: name it, like --body quad1, and start one "
                    "command for each vehicle"
                )
            bodies = {name: name for name in self.body or (THE_VEHICLE,)}
            check_name(next(iter(bodies)))
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

    def run(self) -> int:
        system = self._connected()
        bodies = self._checked(system)
        from console.trackers.bearings import BearingsTracker
        from console.trackers.process import Tracker as Poses
        from console.trackers.source import Connection, HasViews
        from quadlab.station_client import await_session
        from vehicle_link.defects import end_at_defect
        from vehicle_link.termination_signal import EndSignal

        end_at_defect()
        stopping = EndSignal()
        host = self.host or HERE
        port = SYSTEMS[self.system].offer.port if self.port is None else self.port
        where = f" at {host}:{port}" if port else ""
        views = system.views if isinstance(system, HasViews) else ()
        if isinstance(system, HasViews):
            where = f" {system.where}"
        session = await_session(
            self.loopback_port, stopping, lambda line: print(f"tracker: {line}", flush=True)
        )
        if session is None:
            return 0
        print(f"tracker: {self.system}{where}, for {', '.join(bodies)}", flush=True)
        connection = Connection(host, port, session, bodies, data_folder(self.data))
        kind = BearingsTracker if self.of_bearings else Poses
        kind(
            f"{self.system}{where}",
            lambda: system.open(connection),
            bodies,
            session,
            self.unit,
            self.up,
            views=views,
        ).run(stopping)
        session.close()
        return 0


def _options() -> dict[str, type]:
    """Return the options that systems add, by the names of their types."""
    found: dict[str, type] = {}
    for offered in SYSTEMS.values():
        if offered.offer.options:
            with suppress(UsageError):  # told when the system is chosen, and loaded again
                kind = offered.load(offered.offer.options)
                found[kind.__name__] = kind
    return found


if TYPE_CHECKING:
    Tracker = TrackerCommand
else:
    Tracker = make_dataclass(
        "Tracker",
        [
            (name, Annotated[kind, tyro.conf.arg(name="")], field(default_factory=kind))
            for name, kind in _options().items()
        ],
        bases=(TrackerCommand,),
        namespace={"__doc__": TrackerCommand.__doc__},
    )
"""The command, with the options of all systems."""


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
