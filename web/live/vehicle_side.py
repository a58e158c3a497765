"""The part of the web process for one vehicle: what came of it, its pages, its way to the station.

People, catalogue, links, exports and replays are shared by all of them.
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
from web.app_parts import Parts
from web.beacons.survey import SurveyDesk, SurveyRun
from web.commands.control import Control
from web.commands.emergency import EmergencyDesk
from web.commands.sticks import StickOutput
from web.commands.trajectories import TrajectoryDesk
from web.live.events import EventHub, Message
from web.live.forwarding import Forwarding
from web.live.latest import Live
from web.live.station import Station
from web.live.telemetry import TelemetryFeed
from web.parameters.changes import GainPath
from web.parameters.follower import ParameterFollower
from web.parameters.replica import PageParameters
from web.replay.store import ReplayStore
from web.runs.exports import ViserExports
from web.runs.report_making import ReportMaking
from web.view.scene import Scene
from web.view.server import ViewServer

Connect = Callable[[str, Live, EventHub], Station]
"""Makes the station's client: of this vehicle, for these."""


class Runs(Protocol):
    """A part that has a loop of its own."""

    async def run(self) -> None: ...


@dataclass(frozen=True)
class Shared:
    """The parts that all vehicles share."""

    base_url: str
    people: People
    catalogue: Catalogue
    links: SignedLinks
    exports: ViserExports
    reports: ReportMaking
    replays: ReplayStore
    tls: Tls | None
    survey: SurveyRun | None = None


class VehicleSide:
    """One vehicle's, wired. Args: `hub` of its pages; `view_server` of its 3D view."""

    def __init__(
        self, name: str, shared: Shared, connect: Connect, hub: EventHub, view_server: ViewServer
    ) -> None:
        self.name = name
        self.hub = hub
        live = Live(decode)

        def tell(message: Message) -> None:
            hub.publish(message)
            forwarding.told(message, replica.values)

        replica = PageParameters(tell)
        scene = Scene(view_server, live)
        self._view_server = view_server
        self.station = station = connect(name, live, hub)
        forwarding = Forwarding(station.forward)
        self._follower = ParameterFollower(replica, station, live, scene, f"/{name}")
        station.on_change = self._follower.changed_from_thread
        self._stick = StickOutput(station.publish_stick)
        station.on_stick_answer = self._stick.answer_from_thread
        feed = TelemetryFeed(live)
        people = shared.people
        control = Control(live, lambda: people.sockets.labels, station.publish_presence)

        def airborne() -> bool:
            status = live.current("status")
            return status is not None and bool(status.airborne)

        engine = shared.catalogue.engine
        self.loops: Iterable[Runs] = (scene, feed, self._follower, control, forwarding)
        self.parts = Parts(
            vehicle=name,
            base_url=shared.base_url,
            people=people,
            live=live,
            hub=hub,
            feed=feed,
            view_server=view_server,
            scene=scene,
            station=station,
            replica=replica,
            gains=GainPath(replica, station, airborne),
            history=ParameterHistory(engine, name),
            presets=ParameterPresets(engine, name),
            catalogue=shared.catalogue,
            tls=shared.tls,
            links=shared.links,
            exports=shared.exports,
            reports=shared.reports,
            replays=shared.replays,
            stick=self._stick,
            emergency=EmergencyDesk(
                station,
                live,
                hub.publish,
                hub.say,
                chosen=lambda: replica.value("safety.emergency_land"),
            ),
            control=control,
            forwarding=forwarding,
            survey=SurveyDesk(shared.survey),
            trajectories=TrajectoryDesk(live, replica, scene),
        )

    @property
    def is_looked_at(self) -> bool:
        """Return whether a page of this vehicle is open."""
        return bool(self.hub.pages or self.parts.feed.pages or self._view_server.watched)

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        for part in (self.hub, self._follower, self._stick):
            part.attach(loop)

    def stop(self) -> None:
        self.parts.survey.stop()
        self.station.stop()
        self._view_server.stop()
