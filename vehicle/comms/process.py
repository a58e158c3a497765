"""The comms process: Zenoh and the onboard log, next to the flight process and unable to delay it.

One thread drains flight's messages, about every 10 ms; Zenoh's threads deliver the station's. Run
as `python -m vehicle.comms.process CONFIG` by vehicle.processes.parent, which restarts it when it
dies.
"""

from __future__ import annotations

import json
import os
import sys
import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path

import msgspec

from quadrotor.errors import QuadlabError
from vehicle import mailbox
from vehicle.boards.kind import find_kind
from vehicle.boards.offered import offer
from vehicle.calibration.store import CalibrationStore
from vehicle.comms.calibrations import Calibrations
from vehicle.comms.commands import FlightMailbox, FlightParameters
from vehicle.comms.deferred_events import DeferredEvents
from vehicle.comms.inbound import Inbound
from vehicle.comms.lane import CommsLane
from vehicle.comms.publish import FLOWN_ON, LinkRadio, Publisher
from vehicle.comms.self_checks import SelfChecks
from vehicle.comms.services import serve
from vehicle.comms.start_certificates import certificates_in_time
from vehicle.comms.vehicle_clock import VehicleClock
from vehicle.estimators.offer import offer_plugins
from vehicle.onboard_log.files import OnboardFiles
from vehicle.onboard_log.onboard_log import OnboardLog
from vehicle.onboard_log.parameters import log_parameters
from vehicle.onboard_log.reader import OnboardReader
from vehicle.onboard_log.ring import Fetched
from vehicle.processes.config import TICK_SLOTS, Rings, VehicleConfig, open_rings
from vehicle.processes.parent import DEAF, GIVEN_UP, PLUGINS
from vehicle.processes.terminal import say, speak_for
from vehicle_link import topics
from vehicle_link.clock import monotonic_ns
from vehicle_link.defects import end_at_defect
from vehicle_link.jobs import die_with_parent
from vehicle_link.lockstep import COMMS_PROCESS, ProcessProgress
from vehicle_link.security.authority import readable_keys
from vehicle_link.set_clock import SetClock
from vehicle_link.termination_signal import Ending, EndSignal
from vehicle_link.transport.heartbeat import HEARTBEAT_RATE, LINK_HEARTBEAT_EVERY
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received
from vehicle_link.transport.session import vehicle_session
from vehicle_link.transport.whoami import serve_whoami

SHORTEST_WAIT_S = 0.001
STATION_LOST_S = 1.0
FETCH_PERIOD_NS = 1_000_000_000
CLOSE_PATIENCE_S = 0.5
TICKS_KEPT = TICK_SLOTS // 2
"""Largest number of ticks kept until they are in the file: flight needs the room first."""


class Comms:
    """The comms process with all its parts."""

    def __init__(self, config: VehicleConfig, rings: Rings, node: Node) -> None:
        self._rings = rings
        self._clock = VehicleClock(config.line_ns)
        self._flight = FlightMailbox(rings)
        offer_plugins(Path(config.data) / PLUGINS)
        kind = find_kind(config.board)
        offer(kind.configured(config.board_options), live=kind.live)
        self._parameters = FlightParameters(self._flight, config.parameters)
        self._events: deque[mailbox.Event] = deque()
        self._bearing_poses: deque[tuple[bytes, int]] = deque()
        self._notices = list(config.notices)
        self._deferred = DeferredEvents()
        self._radio = LinkRadio(node)
        self._calibrations = Calibrations(
            self._flight,
            CalibrationStore(Path(config.data), lambda line: self._say(mailbox.WARN, line)),
            self._clock.now_ns,
            self._say,
            self._gyroscope_s,
            config.refused_calibrations,
            config.started_ns,
        )
        fetched, identity = Fetched(), config.identity  # motors start with no other
        self._log = OnboardLog(
            Path(config.data),
            config.name,
            {
                "parameters.json": self._parameters_json,
                "calibrations.json": self._calibrations.in_force_json,
            },
            self._say,
            facts={"robot_id": str(identity.robot_id), "firmware_revision": str(identity.firmware)},
            limits=lambda: log_parameters(self._parameters.replica.values()),
            fetched=fetched,
            written=rings.ticks.free,
        )
        before = rings.ticks.read_before()  # of a comms process that died: not in its file
        if len(before):
            self._log.ticks(before, int(before["imu"]["stamp_ns"][-1]))
        self._publisher = Publisher(
            self._radio, self._log, self._clock, config.name, config.packets
        )
        self._publisher.instance = config.instance
        self._progress = ProcessProgress(config.name)
        self._progress.is_this_process(COMMS_PROCESS)
        self._inbound = Inbound(
            self._flight,
            self._clock,
            self._say,
            lambda payload, stamp_ns: self._bearing_poses.append((payload, stamp_ns)),
            self._log_received,
            resumes=rings.ticks.was_read,
        )
        self._longest_wait_s = 1.0 / config.packets
        self._dropped = 0
        self._set_clock = SetClock("vehicle")
        self._fetch_due_ns = 0
        serve(node, self._flight, self._parameters, self._calibrations, self._clock, self._say)
        serve_whoami(node, config.name, config.instance, identity)
        self._checks = SelfChecks(Path(config.data), identity=identity, log=self._log)
        node.serve("checks", topics.SERVICES["checks"], self._checks.answer)
        reader = OnboardReader(self._log, config.name)
        node.serve("onboard_log", topics.SERVICES["onboard_log"], reader.answer)
        OnboardFiles(
            self._log.folder, self._log.files, fetched, repair=lambda: self._log.repair.state
        ).serve(node)
        self._lane = CommsLane(node, config.link_port + 1, self._received_by_lane, config.link_host)
        beats_every = LINK_HEARTBEAT_EVERY if config.packets < HEARTBEAT_RATE else 1
        self._lane.send(self._radio.publishers, beats_every)
        for topic in self._inbound.handlers:
            self._lane.subscribe(topic, self._receiver(topic))
        self._lane.start()

    def run(self, stopping: Ending) -> bool:
        """Run until `stopping` is set; then drain once more, so that nothing read is lost.

        Return False, before that, when no command can arrive any more.
        """
        wait_s = self._longest_wait_s
        while not stopping.wait(wait_s):
            self.drain()
            if self._lane.is_deaf:
                return False
            # In step with the ticks: a packet leaves as soon as its last tick arrives.
            wait_s = min(self._longest_wait_s, max(SHORTEST_WAIT_S, self._publisher.next_packet_s))
        self.drain()
        return True

    def drain(self) -> None:
        """Read everything flight has sent and pass it on."""
        read_ns = monotonic_ns()
        ticks = self._rings.ticks.read()
        if (too_many := len(self._rings.ticks) - TICKS_KEPT) > 0:  # the disk is slow
            self._rings.ticks.free_ahead(too_many)
        if len(ticks):
            if not self._parameters.complete and read_ns >= self._fetch_due_ns:
                self._fetch_due_ns = read_ns + FETCH_PERIOD_NS
                self._parameters.fetch()
            self._inbound.newest_state = ticks["state"][-1:]
            self._inbound.prepare()
            self._checks.note_armed(bool(ticks["status"]["armed"][-1]))
            self._clock.observe(int(ticks["imu"]["stamp_ns"][-1]), read_ns)
            self._log.ticks(ticks, self._clock.at_ns(read_ns))
            self._publisher.ticks(ticks)
        for _ in range(len(self._rings.readings)):
            if (reading := self._rings.readings.pop()) is not None:
                self._publisher.reading(reading)
        for message in self._rings.outbox.pop_all():
            self._dispatch(mailbox.decode_outbound(message))
        if self._notices and self._inbound.station_silence < STATION_LOST_S:
            for level, text in self._notices:  # not earlier, as no one could read them
                self._events.append(mailbox.Event(self._clock.now_ns(), level, text))
            self._notices.clear()
        if report := self._deferred.due(read_ns * 1e-9, self._inbound.station_silence):
            self._events.append(mailbox.Event(self._clock.now_ns(), *report))
        self._inbound.report_silence()
        while self._bearing_poses:
            self._publisher.bearing_pose(*self._bearing_poses.popleft())
        while self._events:
            self._publisher.event(self._events.popleft())
        self._publisher.station_lost = self._inbound.station_silence > STATION_LOST_S
        self._publisher.holder = self._inbound.holder
        self._publisher.heartbeat()
        self._watch_drops()
        if line := self._set_clock.report():
            self._say(mailbox.WARN, line)

    def close(self) -> None:
        """Close the log and send the last events; the caller closes the session."""
        self._log.close()
        self._radio.close()
        self._lane.close()

    def _dispatch(self, message: mailbox.Outbound) -> None:
        if isinstance(message, mailbox.Reply):
            self._flight.deliver(message)
            self._parameters.deliver(message)
            if self._parameters.complete:
                self._log.start()  # not earlier: its files begin with the parameters
                values = self._parameters.values()
                self._inbound.set_layout(str(values["beacons.layout"]))
                self._publisher.estimator = str(values[FLOWN_ON])
        elif isinstance(message, mailbox.Described):
            self._parameters.describe(message)
        elif isinstance(message, mailbox.Event):
            if self._deferred.defer(message, self._inbound.station_silence):
                say(message.text)
            self._publisher.event(message)
        elif isinstance(message, mailbox.GyroscopeFound):
            self._calibrations.found(message)
        else:
            self._parameters.changed(message)
            if message.name == "beacons.layout":
                self._inbound.set_layout(str(message.new))
            self._publisher.parameter_change(message)

    def _watch_drops(self) -> None:
        rings = self._rings
        dropped = rings.ticks.dropped + rings.outbox.dropped + rings.readings.dropped
        if dropped > self._dropped:
            self._say(
                mailbox.ERROR,
                f"{dropped} ticks, readings or replies of flight lost since the start: "
                "comms was too slow",
            )
            self._dropped = dropped

    def _receiver(self, topic: str) -> Callable[[Received], None]:
        return lambda received: self._inbound.handle(topic, received.payload, received.gid)

    def _received_by_lane(self, topic: str, received: Received) -> None:
        """Note a heartbeat of the station that holds the vehicle: its earlier poses have reached
        flight, and need not be sent over Zenoh.
        """
        if topic == "station_heartbeat":
            beat = topics.decode_heartbeat(received.payload)
            if beat.instance == self._inbound.holder:
                self._lane.note_received(received.gid)
                self._progress.station_received(beat.stamp_ns)

    def _log_received(self, topic: str, payload: bytes, stamp_ns: int) -> None:
        type_name = topics.TOPICS[topic].type_name
        self._log.message(topic, type_name, payload, stamp_ns, self._clock.now_ns())

    def _say(self, level: int, text: str) -> None:
        """Publish an event of this process, from any of its threads."""
        self._events.append(mailbox.Event(self._clock.now_ns(), level, text))
        if level > mailbox.INFO:
            say(text)

    def _gyroscope_s(self) -> float:
        samples = int(self._parameters.values()["safety.gyro_samples"])
        return samples / self._publisher.tick_rate

    def _parameters_json(self) -> bytes:
        return json.dumps(self._parameters.values(), indent=1).encode()


def main(argument: str) -> int:
    """Run the process; return 0 after a signal, GIVEN_UP when it cannot start.

    It ends with status DEAF, as if it was killed, when no command can arrive any more.
    """
    end_at_defect()
    config = msgspec.json.decode(argument, type=VehicleConfig)
    speak_for(config.name)
    die_with_parent(config.parent)
    stopping = EndSignal()
    try:
        folder = Path(config.data) / "certificates"
        is_enrolled = (folder / "ca.pem").exists()
        if (files := certificates_in_time(folder, stopping)) is None:
            return 0
        session = vehicle_session(config.link_port, files, config.link_host)
    except QuadlabError as error:
        say(str(error))
        return GIVEN_UP
    if not is_enrolled:
        say(
            f"made its own certificates in {folder}; a base on another machine is accepted after "
            "`quadlab link enrol` there"
        )
    for line in readable_keys(files):
        say(line)
    comms = Comms(config, open_rings(config.rings), Node(session, f"/{config.name}", "vehicle"))
    if not comms.run(stopping):
        os._exit(DEAF)
    comms.close()
    # Notifies the station at once; when the peer has vanished this could take 10 s.
    closing = threading.Thread(target=session.close, daemon=True)
    closing.start()
    closing.join(CLOSE_PATIENCE_S)
    os._exit(0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
