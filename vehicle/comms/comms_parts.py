"""The parts of the comms process, and what each is made from.

Each part is made when another one, or the process, first needs it.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable
from functools import cached_property
from pathlib import Path

from vehicle import mailbox
from vehicle.calibration.store import CalibrationStore
from vehicle.comms.calibrations import Calibrations
from vehicle.comms.commands import FlightMailbox, FlightParameters
from vehicle.comms.inbound import Inbound
from vehicle.comms.lane import CommsLane
from vehicle.comms.publish import FLOWN_ON, LinkRadio, Publisher
from vehicle.comms.self_checks import SelfChecks
from vehicle.comms.services import serve
from vehicle.comms.vehicle_clock import VehicleClock
from vehicle.onboard_log.files import OnboardFiles
from vehicle.onboard_log.onboard_log import OnboardLog
from vehicle.onboard_log.parameters import log_parameters
from vehicle.onboard_log.reader import OnboardReader
from vehicle.onboard_log.ring import Fetched
from vehicle.processes.config import Rings, VehicleConfig
from vehicle.processes.terminal import say
from vehicle_link.lockstep import COMMS_PROCESS, ProcessProgress
from vehicle_link.topics.control_inputs import decode_heartbeat
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.heartbeat import HEARTBEAT_RATE, LINK_HEARTBEAT_EVERY
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received
from vehicle_link.transport.whoami import serve_whoami


class CommsParts:
    """The parts of one vehicle's comms process.

    Attributes:
        events, bearing_poses: what parts leave, from any thread, for the process to publish.
    """

    def __init__(self, config: VehicleConfig, rings: Rings, node: Node) -> None:
        self.config, self.rings, self.node = config, rings, node
        self.data = Path(config.data)
        self.clock = VehicleClock(config.line_ns)
        self.events: deque[mailbox.Event] = deque()
        self.bearing_poses: deque[tuple[bytes, int]] = deque()

    def say(self, level: int, text: str) -> None:
        """Leave an event of this process, from any of its threads."""
        self.events.append(mailbox.Event(self.clock.now_ns(), level, text))
        if level > mailbox.INFO:
            say(text)

    # ------------------------------------------------------------------ the flight process
    @cached_property
    def flight(self) -> FlightMailbox:
        return FlightMailbox(self.rings)

    @cached_property
    def parameters(self) -> FlightParameters:
        return FlightParameters(self.flight, self.config.parameters)

    @cached_property
    def calibrations(self) -> Calibrations:
        return Calibrations(
            self.flight,
            CalibrationStore(self.data, lambda line: self.say(mailbox.WARN, line)),
            self.clock.now_ns,
            self.say,
            gyroscope_s=self._gyroscope_s,
            refused=self.config.refused_calibrations,
            since_ns=self.config.started_ns,
        )

    def _gyroscope_s(self) -> float:
        samples = int(self.parameters.values()["safety.gyro_samples"])
        return samples / self.publisher.tick_rate

    # ------------------------------------------------------------------ the onboard log
    @cached_property
    def fetched(self) -> Fetched:
        return Fetched()

    @cached_property
    def log(self) -> OnboardLog:
        identity = self.config.identity  # motors start with no other
        return OnboardLog(
            self.data,
            self.config.name,
            {
                "parameters.json": lambda: json.dumps(self.parameters.values(), indent=1).encode(),
                "calibrations.json": self.calibrations.in_force_json,
            },
            self.say,
            facts={"robot_id": str(identity.robot_id), "firmware_revision": str(identity.firmware)},
            limits=lambda: log_parameters(self.parameters.replica.values()),
            fetched=self.fetched,
            written=self.rings.ticks.free,
        )

    @cached_property
    def files(self) -> OnboardFiles:
        log = self.log
        return OnboardFiles(log.folder, log.files, self.fetched, repair=lambda: log.repair.state)

    # ------------------------------------------------------------------ what leaves
    @cached_property
    def radio(self) -> LinkRadio:
        seldom = self.config.packets < HEARTBEAT_RATE
        return LinkRadio(self.node, self.lane.paths(LINK_HEARTBEAT_EVERY if seldom else 1))

    @cached_property
    def publisher(self) -> Publisher:
        config = self.config
        return Publisher(
            self.radio,
            self.log,
            self.clock,
            config.name,
            estimator=lambda: str(self.parameters.replica.values()[FLOWN_ON]),
            station=self.inbound,
            instance=config.instance,
            packets=config.packets,
        )

    # ------------------------------------------------------------------ what comes in
    @cached_property
    def progress(self) -> ProcessProgress:
        progress = ProcessProgress(self.config.name)
        progress.is_this_process(COMMS_PROCESS)
        return progress

    @cached_property
    def inbound(self) -> Inbound:
        return Inbound(
            self.flight,
            self.clock,
            self.say,
            lambda payload, stamp_ns: self.bearing_poses.append((payload, stamp_ns)),
            self._log_received,
            resumes=self.rings.ticks.was_read,
        )

    def _log_received(self, topic: str, payload: bytes, stamp_ns: int) -> None:
        type_name = TOPICS[topic].type_name
        self.log.message(topic, type_name, payload, stamp_ns, self.clock.now_ns())

    @cached_property
    def lane(self) -> CommsLane:
        config = self.config
        return CommsLane(self.node, config.link_port + 1, self._received_by_lane, config.link_host)

    def _received_by_lane(self, topic: str, received: Received) -> None:
        """Note a heartbeat of the station that holds the vehicle: its earlier poses have reached
        flight, and need not be sent over Zenoh.
        """
        if topic == "station_heartbeat":
            beat = decode_heartbeat(received.payload)
            if beat.instance == self.inbound.holder:
                self.lane.note_received(received.gid)
                self.progress.station_received(beat.stamp_ns)

    # ------------------------------------------------------------------ services
    @cached_property
    def checks(self) -> SelfChecks:
        return SelfChecks(self.data, identity=self.config.identity, log=self.log)

    def serve(self) -> None:
        """Answer all services from now on."""
        node, config = self.node, self.config
        serve(node, self.flight, self.parameters, self.calibrations, self.clock, self.say)
        serve_whoami(node, config.name, config.instance, config.identity)
        node.serve("checks", SERVICES["checks"], self.checks.answer)
        reader = OnboardReader(self.log, config.name)
        node.serve("onboard_log", SERVICES["onboard_log"], reader.answer)
        self.files.serve(node)

    def receive(self) -> None:
        """Receive the station's messages from now on."""
        for topic in self.inbound.handlers:
            self.lane.subscribe(topic, self._receiver(topic))
        self.lane.start()

    def _receiver(self, topic: str) -> Callable[[Received], None]:
        return lambda received: self.inbound.handle(topic, received.payload, received.gid)
