"""Everything of one vehicle that features share: messages, pages, access to the station.

People, catalogue and links are shared by all vehicles. What one feature alone needs is with that
feature (`web.features`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from console.catalogue.catalogue import Catalogue
from console.parameters.history import ParameterHistory
from console.parameters.presets import ParameterPresets
from console.runs.event_book import EventBook
from quadrotor.parameter_description import ParameterValue
from vehicle_link.messages import decode
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.parameters.last_change import LastChange
from web.access.people import People
from web.access.signed_links import SignedLinks
from web.access.tls import Tls
from web.commands.control import Control
from web.commands.drafts import Drafts
from web.commands.emergency import EmergencyCommands
from web.commands.sticks import Axes, StickOutput
from web.commands.trajectories import TrajectoryMonitor
from web.latest import Live
from web.live.events import EventHub, Message, kept_lines
from web.live.forwarding import Forwarding
from web.live.signal_log import SignalLog
from web.live.station import Reactions, Station
from web.live.telemetry import TelemetryFeed
from web.live.tracking import LiveTracking
from web.parameters.follower import ParameterFollower
from web.parameters.replica import PageParameters
from web.parameters.writer import ParameterWriter
from web.view.scene import Scene
from web.view.server import ViewServer

Connect = Callable[[str, Live, EventHub, Reactions], Station]
"""Called with the arguments of `Station` after its session; returns the vehicle's client."""


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
    tls: Tls | None


class VehicleContext:
    """All services of one vehicle, connected to each other.

    Args:
        vehicle: name of the vehicle.
        hub: the event hub of its pages.
        view_server: the server of its 3D view.

    Attributes:
        closing: ends the services that a feature has for this vehicle.
        wanted: fast topics that a feature wants now, whatever pages show.
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
        self.closing = contextlib.ExitStack()
        self.wanted: frozenset[str] = frozenset()
        self.history = ParameterHistory(shared.catalogue.engine, vehicle)
        self.presets = ParameterPresets(shared.catalogue.engine, vehicle)
        hub.begin(kept_lines(EventBook(shared.catalogue.engine, vehicle), self.history))

        self.log = SignalLog(self._began_anew)
        self.live = live = Live(decode, also=self.log.put)
        self.feed = TelemetryFeed(live, self.log)
        self.tracking = LiveTracking(self.log)
        self.replica = PageParameters(self._publish_parameters)
        self.scene = Scene(view_server, live)
        self.stick = StickOutput(self._publish_stick)
        self.last_change = LastChange()
        reactions = Reactions(
            partial(hub.call, self._note_change), partial(hub.call, self.stick.answer)
        )
        self.station = station = connect(vehicle, live, hub, reactions)
        self.forwarding = Forwarding(station.forward)
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
        self.drafts = Drafts(view_server, self.trajectories, hub.publish, self.replica.value)
        self.loops: Iterable[Runs] = (
            self.scene,
            self.feed,
            ParameterFollower(self.replica, station, live, self.scene, f"/{vehicle}"),
            self.control,
            self.forwarding,
            self.drafts,
        )

    @property
    def is_looked_at(self) -> bool:
        """Return whether a page of this vehicle is open."""
        return bool(self.hub.pages or self.feed.pages or self.view_server.watched)

    def stop(self) -> None:
        self.closing.close()
        self.trajectories.stop()
        self.station.stop()
        self.view_server.stop()

    def _began_anew(self) -> None:
        self.hub.say("warn", f"the clock of {self.vehicle} began anew, and so do the charts")

    def _publish_parameters(self, message: Message) -> None:
        self.hub.publish(message)
        self.forwarding.parameters_changed(message, self.replica.values)

    def _publish_stick(self, axes: Axes, enabled: bool, requester: str) -> int:
        return self.station.publish_stick(axes, enabled, requester)

    def _note_change(self, change: ParameterChange) -> None:
        self.replica.note_change(change)
        if self._is_airborne():
            self.last_change.note(change)

    def restorable(self) -> dict[str, ParameterValue]:
        """Return the values from before the last act of this flight that differ by now."""
        if not self._is_airborne():
            self.last_change.forget()
        value = self.replica.value
        return {name: old for name, old in self.last_change.old.items() if value(name) != old}

    def _is_airborne(self) -> bool:
        status = self.live.current("status")
        return status is not None and bool(status.airborne)
