"""Everything of one vehicle that its routes use: messages, pages, access to the station.

People, catalogue, links, exports and replays are shared by all vehicles.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

from console.catalogue.catalogue import Catalogue
from console.parameters.history import ParameterHistory
from console.parameters.presets import ParameterPresets
from vehicle_link.messages import decode
from web.access.people import People
from web.access.signed_links import SignedLinks
from web.access.tls import Tls
from web.beacons.survey import BeaconSurvey, SurveyRun
from web.commands.control import Control
from web.commands.drafts import Drafts
from web.commands.emergency import EmergencyCommands
from web.commands.sticks import StickOutput
from web.commands.trajectories import TrajectoryMonitor
from web.live.events import EventHub, Message
from web.live.forwarding import Forwarding
from web.live.latest import Live
from web.live.station import Station
from web.live.telemetry import TelemetryFeed
from web.parameters.follower import ParameterFollower
from web.parameters.replica import PageParameters
from web.parameters.writer import ParameterWriter
from web.replay.store import ReplayStore
from web.runs.exports import ViserExports
from web.runs.report_making import ReportMaking
from web.setup.camera_calibration import CameraCalibrations
from web.view.draft import DraftView
from web.view.scene import Scene
from web.view.server import ViewServer

Connect = Callable[[str, Live, EventHub], Station]
"""Called with a vehicle's name, Live and EventHub; returns its client of the station."""


class Runs(Protocol):
    """Service with its own loop."""

    async def run(self) -> None: ...


@dataclass(frozen=True)
class SharedServices:
    """Services that all vehicles share; `tls` is the certificate of the page, None without TLS."""

    base_url: str
    people: People
    catalogue: Catalogue
    links: SignedLinks
    exports: ViserExports
    reports: ReportMaking
    replays: ReplayStore
    cameras: CameraCalibrations
    tls: Tls | None
    survey: SurveyRun | None = None


class VehicleContext:
    """All services of one vehicle, connected to each other.

    Args:
        vehicle: name of the vehicle.
        hub: the event hub of its pages.
        view_server: the server of its 3D view.
    """

    def __init__(
        self,
        vehicle: str,
        shared: SharedServices,
        connect: Connect,
        hub: EventHub,
        view_server: ViewServer,
    ) -> None:
        self.vehicle, self.hub, self.view_server = vehicle, hub, view_server
        self.base_url, self.tls = shared.base_url, shared.tls
        self.people, self.catalogue, self.links = shared.people, shared.catalogue, shared.links
        self.exports, self.reports, self.replays = shared.exports, shared.reports, shared.replays
        self.cameras = shared.cameras
        self.survey = BeaconSurvey(shared.survey)
        self.history = ParameterHistory(shared.catalogue.engine, vehicle)
        self.presets = ParameterPresets(shared.catalogue.engine, vehicle)

        self.live = live = Live(decode)
        self.feed = TelemetryFeed(live)
        self.replica = PageParameters(self._publish_parameters)
        self.scene = Scene(view_server, live)
        self.station = station = connect(vehicle, live, hub)
        self.forwarding = Forwarding(station.forward)
        self._follower = ParameterFollower(self.replica, station, live, self.scene, f"/{vehicle}")
        station.on_change = self._follower.changed_from_thread
        self.stick = StickOutput(station.publish_stick)
        station.on_stick_answer = self.stick.answer_from_thread
        sockets = shared.people.sockets
        self.control = Control(live, lambda: sockets.labels, station.publish_presence)
        self.gains = ParameterWriter(self.replica, station, self._is_airborne)
        self.emergency = EmergencyCommands(
            station,
            live,
            hub.publish,
            hub.say,
            chosen=lambda: self.replica.value("safety.emergency_land"),
        )
        self.trajectories = TrajectoryMonitor(live, self.replica, self.scene)
        self.drafts = Drafts(
            DraftView(view_server), self.trajectories, hub.publish, self.replica.value
        )
        self.loops: Iterable[Runs] = (
            self.scene,
            self.feed,
            self._follower,
            self.control,
            self.forwarding,
            self.drafts,
        )

    @property
    def is_looked_at(self) -> bool:
        """Return whether a page of this vehicle is open."""
        return bool(self.hub.pages or self.feed.pages or self.view_server.watched)

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        for service in (self.hub, self._follower, self.stick):
            service.attach(loop)

    def stop(self) -> None:
        self.survey.stop()
        self.trajectories.stop()
        self.station.stop()
        self.view_server.stop()

    def _publish_parameters(self, message: Message) -> None:
        self.hub.publish(message)
        self.forwarding.parameters_changed(message, self.replica.values)

    def _is_airborne(self) -> bool:
        status = self.live.current("status")
        return status is not None and bool(status.airborne)
