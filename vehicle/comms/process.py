"""The comms process: Zenoh and the onboard log, next to the flight process and unable to delay it.

One thread drains flight's messages, about every 10 ms; Zenoh's threads deliver the station's. Run
as `python -m vehicle.comms.process CONFIG` by vehicle.processes.parent, which restarts it when it
dies.
"""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

import msgspec

from quadrotor.errors import QuadlabError
from vehicle import mailbox
from vehicle.boards.kind import find_kind
from vehicle.boards.offered import offer
from vehicle.comms.comms_parts import CommsParts
from vehicle.comms.deferred_events import DeferredEvents
from vehicle.comms.start_certificates import certificates_in_time
from vehicle.estimators.offer import offer_plugins
from vehicle.processes.config import (
    DEAF,
    GIVEN_UP,
    PLUGINS,
    TICK_SLOTS,
    Rings,
    VehicleConfig,
    open_rings,
)
from vehicle.processes.terminal import say, speak_for
from vehicle_link.clock import monotonic_ns
from vehicle_link.defects import end_at_defect
from vehicle_link.jobs import die_with_parent
from vehicle_link.security.authority import readable_keys
from vehicle_link.set_clock import SetClock
from vehicle_link.termination_signal import Ending, EndSignal
from vehicle_link.transport.node import Node
from vehicle_link.transport.session import vehicle_session

SHORTEST_WAIT_S = 0.001
FETCH_PERIOD_NS = 1_000_000_000
CLOSE_PATIENCE_S = 0.5
TICKS_KEPT = TICK_SLOTS // 2
"""Largest number of ticks kept until they are in the file: flight needs the room first."""


class Comms:
    """The comms process with all its parts."""

    def __init__(self, config: VehicleConfig, rings: Rings, node: Node) -> None:
        offer_plugins(Path(config.data) / PLUGINS)
        kind = find_kind(config.board)
        offer(kind.configured(config.board_options), live=kind.live)
        parts = CommsParts(config, rings, node)
        self._rings, self._clock, self._say = rings, parts.clock, parts.say
        self._flight, self._parameters = parts.flight, parts.parameters
        self._calibrations, self._log = parts.calibrations, parts.log
        self._events, self._bearing_poses = parts.events, parts.bearing_poses
        self._notices, self._deferred = list(config.notices), DeferredEvents()
        before = rings.ticks.read_before()  # of a comms process that died: not in its file
        if len(before):
            self._log.ticks(before, int(before["imu"]["stamp_ns"][-1]))
        self._lane, self._radio = parts.lane, parts.radio
        self._publisher, self._inbound = parts.publisher, parts.inbound
        self._checks = parts.checks
        self._longest_wait_s = 1.0 / config.packets
        self._dropped = 0
        self._set_clock = SetClock("vehicle")
        self._fetch_due_ns = 0
        parts.serve()
        parts.receive()

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
            self._inbound.note_state(ticks["state"][-1:])
            self._checks.note_armed(bool(ticks["status"]["armed"][-1]))
            self._clock.observe(int(ticks["imu"]["stamp_ns"][-1]), read_ns)
            self._log.ticks(ticks, self._clock.at_ns(read_ns))
            self._publisher.ticks(ticks)
        for _ in range(len(self._rings.readings)):
            if (reading := self._rings.readings.pop()) is not None:
                self._publisher.reading(reading)
        for message in self._rings.outbox.pop_all():
            self._dispatch(mailbox.decode_outbound(message))
        if self._notices and not self._inbound.is_lost:
            for level, text in self._notices:  # not earlier, as no one could read them
                self._events.append(mailbox.Event(self._clock.now_ns(), level, text))
            self._notices.clear()
        now_ns, silence = self._clock.now_ns(), self._inbound.station_silence
        if report := self._deferred.due(read_ns * 1e-9, silence, now_ns):
            self._events.append(report)
        self._inbound.report_silence()
        while self._bearing_poses:
            self._publisher.bearing_pose(*self._bearing_poses.popleft())
        while self._events:
            self._publisher.event(self._events.popleft())
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
            self._publisher.answered()
            if self._parameters.complete:
                self._log.start()  # not earlier: its files begin with the parameters
                self._inbound.set_layout(str(self._parameters.values()["beacons.layout"]))
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
