"""The two programs of `python -m benchmarks link`, one at each end of the impaired link.

    python -m benchmarks.link.ends vehicle|station FOLDER PLAN

Telemetry is sent as on board (vehicle.comms.publish, vehicle.comms.lane) and received as at the
station (hub, radio, console.link.lane, console.link.monitor); in parallel the same bytes are sent
by plain UDP, half a period later: at the same moment, the second would always have the larger of
two delays. Poses are sent in the other direction. Each program runs until it is terminated, and
then writes its notes as FOLDER/<program>.npz.
"""

from __future__ import annotations

import gc
import itertools
import os
import signal
import socket
import struct
import sys
import threading
import time
import zlib
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from benchmarks.impairment.link import A, B
from benchmarks.link.notes import Notebook
from console.link.lane import DATAGRAM, VehicleLane
from console.link.monitor import LinkMonitor
from console.station import SWITCH_INTERVAL
from console.transfers.fetcher import Fetcher
from console.transfers.part_file import PartFile
from console.transfers.vehicle_files import VehicleFile, VehicleFiles
from quadrotor.errors import LinkError
from quadrotor.records import POSE_SAMPLE, TICK
from vehicle.comms.inbound import STATION_LOST_S
from vehicle.comms.lane import CommsLane
from vehicle.comms.publish import PROBE_NS, LinkRadio
from vehicle.safety.parameters import SafetyParameters
from vehicle_link import telemetry
from vehicle_link.lane.datagram import LARGEST, LARGEST_PAYLOAD
from vehicle_link.messages import new
from vehicle_link.process_instance import new_instance
from vehicle_link.security.authority import ensure_certificates
from vehicle_link.termination_signal import EndSignal
from vehicle_link.topics.control_inputs import encode_heartbeat
from vehicle_link.topics.measurements import pose_messages
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.heartbeat import HEARTBEAT_RATE, LinkState
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import OtherPath, Received
from vehicle_link.transport.radio import Radio
from vehicle_link.transport.session import hub_session, vehicle_session
from vehicle_link.transport.time_sync import TIME_SYNC, answers, exchange, serve_time_sync

QUIC_PORT, LOOPBACK_PORT, UDP_PORT = 7447, 7447, 9100
RATE, POSE_RATE, CALL_RATE, LOOK_RATE = 100, 100, 5, 200  # Hz
CALL_TIMEOUT, CALL_TRIES = 1.0, 5
"""Timeout (s) and tries of a call, as when a parameter is set: repeated under the same id."""
LOG = VehicleFile("a_log.mcap", 1 << 31, identity=1, start_ns=1, end_ns=2, closed=True)
COMMAND, PART = SERVICES["arm"], SERVICES["onboard_part"]
STATES = (LinkState.GOOD, LinkState.DEGRADED, LinkState.LOST)
_STAMP = struct.Struct("<qq")  # number, ns
_TELEMETRY = telemetry.pack(np.zeros(telemetry.SAMPLES_A_PACKET, TICK), 0)
_POSE = pose_messages(np.zeros(1, POSE_SAMPLE)).tobytes()
_FRAMING = LARGEST - LARGEST_PAYLOAD


class Plan(msgspec.Struct, frozen=True):
    """The plan of a run.

    Attributes:
        seconds: longest duration, for which notes have room.
        lane: whether the station requests one.
        udp: whether plain UDP runs in parallel.
    """

    seconds: float
    lane: bool = True
    udp: bool = True
    call_rate: float = CALL_RATE


class Program:
    """The common part of both ends: threads until the end, notes, plain UDP in both directions."""

    def __init__(self, folder: Path, plan: Plan) -> None:
        self.folder, self.plan = folder, plan
        self.files = ensure_certificates(folder, [A])
        self.ending = threading.Event()
        self._threads: list[threading.Thread] = []
        self.notes: dict[str, Notebook] = {}
        self._asked_to_end = EndSignal()
        sys.setswitchinterval(SWITCH_INTERVAL)

    def note(self, name: str, columns: int, rate: float) -> Notebook:
        self.notes[name] = Notebook(round(1.2 * rate * self.plan.seconds) + 1000, columns)
        return self.notes[name]

    def every(self, rate: float, act: Callable[[int], None], later: float = 0.0) -> None:
        """Call `act` with 0, 1, … at `rate`, in a thread; `later` is a part of a period."""

        def run() -> None:
            began = time.monotonic() + later / rate
            for k in itertools.count():
                time.sleep(max(0.0, began + k / rate - time.monotonic()))
                if self.ending.is_set():
                    return
                with suppress(LinkError):  # the session is closing
                    act(k)

        self._threads.append(threading.Thread(target=run, daemon=True))

    def udp(self, ours: str, theirs: str, payload: bytes, rate: float, heard: str) -> None:
        """Send as many bytes as a datagram of the lane has; note received ones as `heard`."""
        if not self.plan.udp:
            self.note(heard, 3, 0.0)
            return
        link, notes = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), self.note(heard, 3, RATE)
        link.bind((ours, UDP_PORT))
        data = payload + bytes(_FRAMING)

        def send(k: int) -> None:
            link.sendto(stamped(k, data), (theirs, UDP_PORT))

        self.every(rate, send, later=0.5)

        def listen() -> None:
            while came := link.recv(2000):
                notes.add(*_STAMP.unpack_from(came), time.monotonic_ns())

        threading.Thread(target=listen, daemon=True).start()

    def run(self, name: str) -> None:
        """Run until the end; then write the notes, and exit without waiting for a dead link."""
        gc.collect()
        gc.freeze()
        for thread in self._threads:
            thread.start()
        print("up", flush=True)
        while not self._asked_to_end.wait(1.0):
            pass
        self.ending.set()
        rows: dict[str, Any] = {key: notes.rows for key, notes in self.notes.items()}
        np.savez(self.folder / f"{name}.npz", **rows)
        print("written", flush=True)
        os._exit(0)


def stamped(number: int, payload: bytes) -> bytes:
    return _STAMP.pack(number, time.monotonic_ns()) + payload[_STAMP.size :]


def vehicle(folder: Path, plan: Plan) -> None:
    program = Program(folder, plan)
    node = Node(vehicle_session(QUIC_PORT, program.files), "/quad1", "vehicle")

    def came(topic: str, received: Received) -> None:
        if topic == "station_heartbeat":
            lane.note_received()

    lane = CommsLane(node, QUIC_PORT + 1, came)
    radio = LinkRadio(node, lane.paths())
    heard, timeout = [time.monotonic()], SafetyParameters().link_timeout
    instance, numbers, missing = new_instance(), itertools.count(), [0]

    def silence() -> float:
        return time.monotonic() - heard[0]

    def send(k: int) -> None:
        # A station that is not received is only sent a probe (vehicle.comms.publish).
        if silence() < STATION_LOST_S or k % round(PROBE_NS * 1e-9 * RATE) == 0:
            radio.put("telemetry", stamped(next(numbers), _TELEMETRY), time.time_ns())

    def beat(k: int) -> None:
        now_ns = time.time_ns()
        radio.put("vehicle_heartbeat", encode_heartbeat(k, now_ns, instance), now_ns)

    def look(k: int) -> None:
        if (silence() > timeout) != missing[0]:
            missing[0] = 1 - missing[0]
            silences.add(time.monotonic_ns(), missing[0])

    poses = program.note("poses", 3, POSE_RATE)
    silences = program.note("silences", 2, 1.0)
    lane.subscribe(
        "tracker_pose", lambda r: poses.add(*_STAMP.unpack_from(r.payload), time.monotonic_ns())
    )
    lane.subscribe("station_heartbeat", lambda r: heard.__setitem__(0, time.monotonic()))
    lane.start()
    serve_time_sync(node, time.time_ns)
    node.serve("arm", COMMAND, lambda request: new(f"{COMMAND}_Response", accepted=True))
    node.serve("onboard_part", PART, _FileServer().answer)
    program.every(RATE, send)
    program.every(HEARTBEAT_RATE, beat, later=0.3)
    program.every(LOOK_RATE, look)
    program.udp(A, B, _TELEMETRY, RATE, "udp_poses")
    program.run("vehicle")


class _FileServer:
    """Replacement of the vehicle's own log: bytes that cannot be compressed."""

    def __init__(self) -> None:
        self._data = os.urandom(1 << 20)

    def answer(self, request: Any) -> Any:
        length = int(request.length)
        begin = int(request.offset) % (len(self._data) - length)
        data = self._data[begin : begin + length]
        octets = np.frombuffer(data, np.uint8)
        file = new("quadlab_msgs/OnboardFile", name=LOG.name, identity=1, size=LOG.size)
        crc = zlib.crc32(data)
        return new(f"{PART}_Response", accepted=True, file=file, data=octets, crc32=crc)


def station(folder: Path, plan: Plan) -> None:
    program = Program(folder, plan)
    node = Node(hub_session(LOOPBACK_PORT), "/quad1", "station")
    instance = new_instance()
    link, state = LinkMonitor("quad1", instance), [2]
    heard, calls = program.note("telemetry", 5, RATE), program.note("calls", 2, plan.call_rate)
    states = program.note("states", 2, 1.0)

    def telemetry_came(received: Received) -> None:
        number, sent_ns = _STAMP.unpack_from(received.payload)
        now_ns, wall_ns = time.monotonic_ns(), time.time_ns()
        shown = link.telemetry(number, received.source_ns, received.received_ns, wall_ns)
        heard.add(number, sent_ns, now_ns, int(shown), int(link.path == DATAGRAM))

    lane = VehicleLane(
        node,
        A if plan.lane else "",
        link,
        telemetry_came,
        lambda received: link.beat(received.payload),
    )
    pose = node.advertise(TOPICS["tracker_pose"])
    beat = node.advertise(TOPICS["station_heartbeat"], OtherPath(lane.send_heartbeat))
    command, clock = node.client("arm", COMMAND), node.client("time_sync", TIME_SYNC)
    radio = Radio(
        f"{A}:{QUIC_PORT}",
        program.files,
        LOOPBACK_PORT,
        link.session_silence,
        lane_silence=link.lane_silence,
        probe=partial(answers, clock),
    )
    download = Download(program, node)

    def ask() -> None:
        began = time.monotonic_ns()
        request = new(f"{COMMAND}_Request", request_id=str(began), requester="benchmark")
        for k in range(CALL_TRIES):  # as in console.commands.gateway
            with suppress(LinkError):
                command.call(request, timeout=CALL_TIMEOUT)
                calls.add(began, time.monotonic_ns() - began)
                return
            again = began * 1e-9 + (k + 1) * CALL_TIMEOUT
            time.sleep(max(0.0, again - time.monotonic()))
        calls.add(began, -1)

    def say_beat(k: int) -> None:
        beat.put(encode_heartbeat(k, time.time_ns(), instance))

    def look(k: int) -> None:
        now = STATES.index(link.state())
        if now != state[0]:
            state[0] = now
            states.add(time.monotonic_ns(), now)

    radio.wait(10.0)
    command.wait(10.0)
    program.every(POSE_RATE, lambda k: pose.put(stamped(k, _POSE)))
    program.every(HEARTBEAT_RATE, say_beat, 0.3)
    program.every(plan.call_rate, lambda k: threading.Thread(target=ask, daemon=True).start(), 0.2)
    program.every(LOOK_RATE, look)
    program.every(1.0, lambda k: link.exchanged(exchange(clock)))
    program.udp(B, A, _POSE, POSE_RATE, "udp")
    signal.signal(signal.SIGUSR1, lambda *_: download.start())
    program.run("station")


class Download:
    """Download of a log, as the station fetches it, until the end."""

    def __init__(self, program: Program, node: Node) -> None:
        self._ending = program.ending
        self._notes = program.note("download", 2, 2000.0)
        self._fetcher = Fetcher(VehicleFiles(node), self._came)
        self._part = PartFile(program.folder, LOG)

    def start(self) -> None:
        threading.Thread(target=self._run, daemon=True).start()

    def _came(self, size: int) -> None:
        self._notes.add(time.monotonic_ns(), size)

    def _run(self) -> None:
        while not self._ending.is_set():
            with suppress(LinkError):  # an outage
                self._fetcher.fetch(self._part)


if __name__ == "__main__":
    which, place, wanted = (
        sys.argv[1],
        Path(sys.argv[2]),
        msgspec.json.decode(sys.argv[3], type=Plan),
    )
    (vehicle if which == "vehicle" else station)(place, wanted)
