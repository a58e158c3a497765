"""The parts of one vehicle's station that most of its other parts use."""

from __future__ import annotations

from dataclasses import dataclass

from console.alarms import Alarms
from console.link.monitor import LinkMonitor
from console.link.outbox import Outbox
from console.parameters.station import StationParameters
from console.runs.recorder import Recorder
from vehicle_link.transport.node import Node


@dataclass(frozen=True, slots=True)
class StationContext:
    """The basis of one vehicle's station.

    Attributes:
        vehicle: its name, which is the namespace of the topics.
        parameters: the station's own, live: read them when they are needed.
    """

    node: Node
    vehicle: str
    link: LinkMonitor
    outbox: Outbox
    recorder: Recorder
    alarms: Alarms
    parameters: StationParameters
