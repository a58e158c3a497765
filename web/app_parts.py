"""The parts that the routes use, in one object."""

from __future__ import annotations

from dataclasses import dataclass

from console.catalogue.catalogue import Catalogue
from console.parameters.history import ParameterHistory
from console.parameters.presets import ParameterPresets
from web.access.people import People
from web.access.signed_links import SignedLinks
from web.access.tls import Tls
from web.beacons.survey import SurveyDesk
from web.commands.control import Control
from web.commands.emergency import EmergencyDesk
from web.commands.sticks import StickOutput
from web.commands.trajectories import TrajectoryDesk
from web.live.events import EventHub
from web.live.forwarding import Forwarding
from web.live.latest import Live
from web.live.station import Station
from web.live.telemetry import TelemetryFeed
from web.parameters.changes import GainPath
from web.parameters.replica import PageParameters
from web.replay.store import ReplayStore
from web.runs.exports import ViserExports
from web.runs.report_making import ReportMaking
from web.view.scene import Scene
from web.view.server import ViewServer


@dataclass(frozen=True)
class Parts:
    """The parts that the routes use."""

    vehicle: str
    base_url: str
    people: People
    live: Live
    hub: EventHub
    feed: TelemetryFeed
    view_server: ViewServer
    scene: Scene
    station: Station
    replica: PageParameters
    gains: GainPath
    history: ParameterHistory
    presets: ParameterPresets
    catalogue: Catalogue
    links: SignedLinks
    exports: ViserExports
    reports: ReportMaking
    replays: ReplayStore
    stick: StickOutput
    control: Control
    emergency: EmergencyDesk
    forwarding: Forwarding
    survey: SurveyDesk
    trajectories: TrajectoryDesk
    tls: Tls | None = None
    """The page's certificate; None without TLS."""
