"""The station's checks in one place: received messages, pre-flight list, start-up checks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from console.checks.alarms import AlarmBoard
from console.checks.gather import Gatherer
from console.checks.observed import Observed
from console.checks.preflight import Preflight
from console.checks.startup import StartupChecks
from console.link.monitor import LinkMonitor
from console.link.outbox import Outbox
from console.parameters.station import StationParameters
from console.parameters.vehicle import VehicleParameters
from console.runs.recorder import Recorder
from console.tracker_feed import TrackerFeed
from vehicle_link.transport.node import Node


class CheckDesk:
    """All checks of one station: builds them from the station's parts.

    Args:
        folder: of the station's runs.
        sticks_dropped: returns whether the stick watchdog has dropped the sticks.
        endpoints: where the station listens and what it dials, in words.
    """

    def __init__(
        self,
        node: Node,
        outbox: Outbox,
        parameters: StationParameters,
        link: LinkMonitor,
        tracker: TrackerFeed,
        vehicle: VehicleParameters,
        recorder: Recorder,
        alarms: AlarmBoard,
        folder: Path,
        sticks_dropped: Callable[[], bool],
        endpoints: str,
    ) -> None:
        self.observed = Observed()
        self.gatherer = Gatherer(
            link,
            self.observed,
            tracker,
            vehicle,
            parameters,
            recorder,
            alarms,
            folder,
            sticks_dropped,
        )
        self.preflight = Preflight(
            self.gatherer.facts, parameters.preflight, outbox, link.vehicle_ns, vehicle.refresh
        )
        self.startup = StartupChecks(
            node, folder.parent, self.gatherer, parameters, outbox.say, endpoints
        )

    def start(self) -> None:
        self.preflight.start()
        self.startup.start()

    def close(self) -> None:
        self.preflight.close()
        self.startup.close()
