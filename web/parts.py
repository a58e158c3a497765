"""What the routes speak to, in one object."""

from __future__ import annotations

from dataclasses import dataclass

from console.catalogue import Catalogue
from web.access.people import People
from web.events import EventHub
from web.live import Live
from web.parameters import GainPath, ParameterMirror
from web.scene import Scene
from web.station import Station
from web.sticks import StickOutput
from web.telemetry import TelemetryFeed
from web.view_server import ViewServer


@dataclass(frozen=True)
class Parts:
    """Everything the routes speak to."""

    vehicle: str
    base_url: str
    people: People
    live: Live
    hub: EventHub
    feed: TelemetryFeed
    view_server: ViewServer
    scene: Scene
    station: Station
    mirror: ParameterMirror
    gains: GainPath
    catalogue: Catalogue
    stick: StickOutput
