"""Measurement of the quality of a link to a vehicle, by a separate station."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import zenoh

from quadrotor.errors import LinkError
from vehicle_link.addresses import parse_endpoint
from vehicle_link.messages import decode, encode, new
from vehicle_link.process_instance import new_instance
from vehicle_link.security.authority import TlsFiles
from vehicle_link.telemetry import unpack
from vehicle_link.topics.control_inputs import decode_heartbeat, encode_heartbeat
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.protocol import disagreement
from vehicle_link.transport.publisher import Received
from vehicle_link.transport.quic_probe import EXPLANATIONS, probe
from vehicle_link.transport.radio import namespaces
from vehicle_link.transport.session import check_station, radio_session, wait_connected
from vehicle_link.transport.time_sync import TIME_SYNC, ClockOffset, exchange
from vehicle_link.transport.whoami import WhoAmI

QUESTIONS = 20  # per second
PATIENCE = 1.0  # s for an answer
READERS = 4
"""Number of concurrent questions with which throughput is measured."""
NAMES = 50
TRIES = 3
CONNECT = 5.0  # s
CLOSE_PATIENCE = 2.0
"""Seconds to wait for closing; it may take ten if the vehicle has gone away in the meantime."""
DESCRIBE, LIST = "rcl_interfaces/srv/DescribeParameters", "rcl_interfaces/srv/ListParameters"


@dataclass
class Figures:
    """The measured figures. Times in s; NaN where nothing was measured."""

    address: str
    vehicle: str = ""
    access: str = ""
    version: str = ""
    disagreement: str = ""
    round_trips: list[float] = field(default_factory=list)
    unanswered: int = 0
    clock_offset: float = math.nan  # vehicle's minus ours
    packets: int = 0  # of telemetry
    rate: float = 0.0  # Hz
    loss: float = math.nan  # share, 0 to 1
    jitter: float = math.nan  # standard deviation of the transit time
    throughput: float = math.nan  # bit/s of background answers
    armed: bool = False
    held_by_another: bool = False


def measure(
    endpoint: str,
    tls: TlsFiles,
    seconds: float = 5.0,
    name: str = "",
    progress: Callable[[str], None] = lambda text: None,
) -> Figures:
    """Connect, measure for `seconds` and disconnect.

    While no other station controls the vehicle and it is not armed, this station takes control, so
    that telemetry arrives at its full rate.

    Args:
        name: the vehicle's; "" uses the name that the vehicle announces.
        progress: called with what is being done.

    Raises:
        LinkError: no link, with the reason as far as known.
        UsageError: the endpoint cannot be parsed.
    """
    check_station(endpoint, tls)
    host, port = parse_endpoint(endpoint)
    progress(f"dialling {host}:{port}")
    with _connected(endpoint, tls, host, port) as session:
        name = name or _only_name(session, host, port)
        node = Node(session, f"/{name}", "link_test")
        found = Figures(f"{host}:{port}", name)
        test = _Test(node, found)
        try:
            progress("asking who it is")
            test.introduce()
            progress(f"measuring for {seconds:g} s")
            test.run(0.75 * seconds, 0.25 * seconds)
        finally:
            node.close()
    return found


@contextmanager
def _connected(endpoint: str, tls: TlsFiles, host: str, port: int) -> Iterator[zenoh.Session]:
    session = radio_session(endpoint, tls)
    try:
        if not wait_connected(session, CONNECT):
            raise LinkError(
                f"no link to {host}:{port} within {CONNECT:g} s: {EXPLANATIONS[probe(host, port)]}"
            )
        yield session
    finally:
        closer = threading.Thread(target=session.close, name="link test close", daemon=True)
        closer.start()
        closer.join(CLOSE_PATIENCE)


def _only_name(session: zenoh.Session, host: str, port: int) -> str:
    deadline = time.monotonic() + CONNECT
    while time.monotonic() < deadline:
        names = namespaces(session)
        if len(names) == 1:
            return names.pop()
        if names:
            raise LinkError(
                f"{host}:{port} has nodes of {', '.join(sorted(names))}; say which with --name"
            )
        time.sleep(0.1)
    raise LinkError(
        f"the link to {host}:{port} is open, but the vehicle sends us nothing: our certificate may "
        "not be a station's, or it runs another version of quadlab; to try anyway, give --name"
    )


class _Test:
    """One measurement, which fills `found`."""

    def __init__(self, node: Node, found: Figures) -> None:
        self._node, self._found = node, found
        self._instance = new_instance()
        self._holder: int | None = None
        self._packets: list[tuple[int, int, int]] = []  # sequence, stamp, received; ns
        for topic, callback in (
            ("telemetry", self._telemetry),
            ("vehicle_heartbeat", self._beat),
            ("status", self._status),
        ):
            row = TOPICS[topic]
            node.subscribe(topic, row.type_name, callback, qos=row.qos)
        self._clock = node.client("time_sync", TIME_SYNC)
        self._list = node.client("vehicle/list_parameters", LIST)
        self._describe = node.client("vehicle/describe_parameters", DESCRIBE, priority="background")
        self._heartbeats = node.advertise(TOPICS["station_heartbeat"])

    def introduce(self) -> None:
        """Ask the vehicle for its identity. Raises LinkError when there is no answer."""
        deadline = time.monotonic() + CONNECT
        while True:
            try:
                answer = WhoAmI(self._node).ask(PATIENCE)
                break
            except LinkError as error:
                if time.monotonic() > deadline:
                    raise LinkError(
                        f"the link to {self._found.address} is open, but no vehicle called "
                        f"{self._found.vehicle} says who it is: it has another name, or its "
                        "quadlab another version"
                    ) from error
                time.sleep(0.1)
        self._found.access, self._found.version = str(answer.access), str(answer.version)
        self._found.disagreement = disagreement(str(answer.protocol), str(answer.version))

    def run(self, quiet: float, busy: float) -> None:
        """Measure the link first without load, then under load next to telemetry."""
        done = threading.Event()
        beats = threading.Thread(target=self._beat_on, args=(done,), daemon=True)
        beats.start()
        try:
            self._ask(quiet)
            packets = list(self._packets)
            if not self._found.armed:
                self._read(busy)
        finally:
            done.set()
            beats.join()
        self._judge(packets, quiet)

    def _ask(self, seconds: float) -> None:
        clock, began = ClockOffset(window=10_000), time.monotonic()
        for k in range(max(1, round(seconds * QUESTIONS))):
            time.sleep(max(0.0, began + k / QUESTIONS - time.monotonic()))
            if time.monotonic() - began > seconds:
                break
            try:
                answered = exchange(self._clock, timeout=PATIENCE)
            except LinkError:
                self._found.unanswered += 1
                continue
            clock.add(answered)
            self._found.round_trips.append(answered.round_trip_ns * 1e-9)
        if clock.known:
            self._found.clock_offset = clock.offset_ns * 1e-9

    def _read(self, seconds: float) -> None:
        """Ask background questions with long answers, several at once."""
        for attempt in range(TRIES):
            try:
                listed = self._list.call(new("rcl_interfaces/srv/ListParameters_Request"), PATIENCE)
                names = list(listed.result.names)[:NAMES]
                request = new("rcl_interfaces/srv/DescribeParameters_Request", names=names)
                size = len(encode(self._describe.call(request, 2 * PATIENCE)))
                break
            except LinkError:
                if attempt + 1 == TRIES:
                    return
        until, answers = time.monotonic() + seconds, [0] * READERS

        def read(reader: int) -> None:
            while time.monotonic() < until:
                try:
                    self._describe.call(request, 2 * PATIENCE)
                except LinkError:
                    continue
                answers[reader] += 1

        began = time.monotonic()
        threads = [threading.Thread(target=read, args=(k,), daemon=True) for k in range(READERS)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self._found.throughput = 8 * size * sum(answers) / (time.monotonic() - began)

    def _judge(self, packets: list[tuple[int, int, int]], seconds: float) -> None:
        found = self._found
        found.packets, found.rate = len(packets), len(packets) / seconds
        found.held_by_another = self._holder not in (None, 0, self._instance)
        if len(packets) < 2:
            return
        numbers = {number for number, _, _ in packets}
        found.loss = 1.0 - len(numbers) / (max(numbers) - min(numbers) + 1)
        ways = [received - stamp for _, stamp, received in packets]
        mean = sum(ways) / len(ways)
        found.jitter = math.sqrt(sum((way - mean) ** 2 for way in ways) / len(ways)) * 1e-9

    def _beat_on(self, done: threading.Event) -> None:
        count = 0
        while not done.wait(0.05):
            if self._holder in (0, self._instance) and not self._found.armed:
                count += 1
                stamp_ns = time.time_ns()
                self._heartbeats.put(encode_heartbeat(count, stamp_ns, self._instance))

    def _telemetry(self, received: Received) -> None:
        try:
            sequence, ticks = unpack(received.payload)
        except (LinkError, ValueError):  # of another protocol, which `disagreement` reports
            return
        self._packets.append((sequence, int(ticks["imu"]["stamp_ns"][-1]), received.received_ns))

    def _beat(self, received: Received) -> None:
        self._holder = decode_heartbeat(received.payload).holder

    def _status(self, received: Received) -> None:
        status = decode(received.payload, TOPICS["status"].type_name)
        self._found.armed = bool(status.armed)
