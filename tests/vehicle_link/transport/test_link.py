"""Real link: a vehicle, a station that routes, and a client on the station's loopback."""

from __future__ import annotations

import itertools
import math
import queue
import socket
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quadrotor.errors import (
    LinkError,
    NoAnswerError,
    ParameterError,
    Refusal,
    RefusedError,
    UnreachableError,
    UsageError,
)
from quadrotor.parameter_description import ParameterDescription, ParameterValue
from quadrotor.parameters import Parameters, ParameterStore, parameter
from quadrotor.records import TICK
from quadrotor.vehicle_model import VehicleModel
from tests.support.station import StationLink
from tests.support.subscribers import has_subscriber
from tests.waiting import free_port, wait_for
from vehicle_link import clock
from vehicle_link.addresses import parse_endpoint
from vehicle_link.messages import new
from vehicle_link.parameters.messages import from_value, to_parameters
from vehicle_link.security.authority import TlsFiles, ensure_certificates
from vehicle_link.telemetry import pack, unpack
from vehicle_link.topics.control_inputs import decode_heartbeat, encode_heartbeat
from vehicle_link.topics.rmw_keys import RELIABLE
from vehicle_link.topics.table import SERVICES, TOPICS, Topic
from vehicle_link.transport.idempotent import Idempotent
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.parameter_service import ParameterClient, serve_parameters
from vehicle_link.transport.publisher import Received
from vehicle_link.transport.session import check_station, hub_session, link_config, vehicle_session
from vehicle_link.transport.time_sync import exchange, serve_time_sync

WAIT = 10.0  # s: a bound, not an expectation
REQUEST, RESPONSE = f"{SERVICES['arm']}_Request", f"{SERVICES['arm']}_Response"


@dataclass(frozen=True)
class Link:
    """The three ends, each with one node in /quad1."""

    vehicle: Node
    station: Node
    web: Node
    tls: TlsFiles
    vehicle_port: int
    loopback_port: int


@pytest.fixture(scope="module")
def link(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Link]:
    tls = ensure_certificates(tmp_path_factory.mktemp("tls"))
    udp = free_port(socket.SOCK_DGRAM)
    # The station starts first: it must not need the vehicle.
    station = StationLink(udp, tls)
    web = loopback_session(station.loopback_port)
    vehicle = vehicle_session(udp, tls)
    assert station.wait(WAIT)
    yield Link(
        Node(vehicle, "/quad1", "vehicle"),
        Node(station.session, "/quad1", "station"),
        Node(web, "/quad1", "web"),
        tls,
        udp,
        station.loopback_port,
    )
    for session in (web, station, vehicle):
        session.close()


class Inbox:
    """Received messages, with a bounded wait."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[Received] = queue.SimpleQueue()

    def __call__(self, received: Received) -> None:
        self._queue.put(received)

    def next(self) -> Received:
        return self._queue.get(timeout=WAIT)


def _ok(request: Any) -> Any:
    return new(RESPONSE, accepted=True, reason=f"{request.request_id} of {request.requester}")


def test_telemetry_goes_from_vehicle_to_station_and_client(link: Link) -> None:
    topic = TOPICS["telemetry"]
    publisher = link.vehicle.advertise(topic)
    inboxes = [Inbox(), Inbox()]
    for node, inbox in zip((link.station, link.web), inboxes, strict=True):
        node.subscribe(topic.name, topic.type_name, inbox)
    assert has_subscriber(publisher, WAIT)
    ticks = np.zeros(5, TICK)
    ticks["state"]["position_w"] = 1.5
    # Until both have received it: best effort, and either subscription may arrive later.
    numbers: list[int] = []
    for inbox in inboxes:
        received = _put_until_heard(publisher, pack(ticks, 9), inbox)
        assert unpack(received.payload)[0] == 9
        np.testing.assert_array_equal(unpack(received.payload)[1]["state"]["position_w"], 1.5)
        assert received.source_ns == 1234
        assert received.received_ns > 10**18
        numbers.append(received.sequence)
    assert all(number >= 1 for number in numbers)


def heartbeats(name: str) -> Topic:
    return Topic(name, "quadlab_msgs/Heartbeat", "vehicle", 0, qos=RELIABLE)


def _put_until_heard(publisher: object, payload: bytes, inbox: Inbox) -> Received:
    deadline = time.monotonic() + WAIT
    while time.monotonic() < deadline:
        publisher.put(payload, 1234)  # type: ignore[attr-defined]
        try:
            return inbox._queue.get(timeout=0.1)
        except queue.Empty:
            continue
    raise AssertionError("nothing was heard")


def test_client_reaches_the_vehicle_best_effort_and_reliably(link: Link) -> None:
    for name, qos in (("web_heartbeat", TOPICS["joy"].qos), ("web_reliable", RELIABLE)):
        inbox = Inbox()
        link.vehicle.subscribe(name, "quadlab_msgs/Heartbeat", inbox)
        publisher = link.web.advertise(Topic(name, "quadlab_msgs/Heartbeat", "web", 0, qos=qos))
        assert has_subscriber(publisher, WAIT)
        received = _put_until_heard(publisher, encode_heartbeat(4, 5), inbox)
        assert decode_heartbeat(received.payload)[:2] == (4, 5)


def test_sequence_counts_from_one_and_time_is_now_unless_given(link: Link) -> None:
    inbox = Inbox()
    link.station.subscribe("counted", "quadlab_msgs/Heartbeat", inbox, qos=RELIABLE)
    publisher = link.vehicle.advertise(heartbeats("counted"))
    assert has_subscriber(publisher, WAIT)
    before = clock.time_ns()  # the computer's own may have been set a little meanwhile
    for number in range(3):
        publisher.put(encode_heartbeat(number, 0))
    received = [inbox.next() for _ in range(3)]
    assert [r.sequence for r in received] == [1, 2, 3]
    assert [decode_heartbeat(r.payload)[0] for r in received] == [0, 1, 2]
    assert all(before <= r.source_ns <= r.received_ns for r in received)


def test_a_callback_that_raises_is_logged_and_hears_the_next(
    link: Link, caplog: pytest.LogCaptureFixture
) -> None:
    inbox = Inbox()

    def fragile(received: Received) -> None:
        inbox(received)
        raise RuntimeError("callback broke")

    link.station.subscribe("fragile", "quadlab_msgs/Heartbeat", fragile)
    publisher = link.vehicle.advertise(heartbeats("fragile"))
    assert has_subscriber(publisher, WAIT)
    for number in range(2):
        publisher.put(encode_heartbeat(number, 0))
    assert [inbox.next().sequence for _ in range(2)] == [1, 2]
    assert "callback broke" in caplog.text


def test_a_callback_that_is_held_up_may_ask_for_the_newest_alone(link: Link) -> None:
    heard: list[bytes] = []
    goes_on, held_up = threading.Event(), threading.Event()

    def hear(received: Received) -> None:
        heard.append(received.payload)
        held_up.set()
        assert goes_on.wait(WAIT)

    topic = TOPICS["truth"]
    link.station.subscribe(topic.name, topic.type_name, hear, newest=3)
    publisher = link.station.advertise(topic)
    while not held_up.wait(0.05):
        publisher.put(b"first")
    for number in range(100):
        publisher.put(b"%d" % number)
    goes_on.set()
    wait_for(lambda: heard[-1] == b"99")
    assert heard[-3:] == [b"97", b"98", b"99"]
    assert len(heard) <= 4


def test_service_of_the_vehicle_answers_client_and_station(link: Link) -> None:
    link.vehicle.serve("arm", SERVICES["arm"], _ok)
    for node in (link.web, link.station):
        client = node.client("arm", SERVICES["arm"])
        assert client.wait(WAIT)
        response = client.call(new(REQUEST, request_id="7", requester=node.name))
        assert response.accepted
        assert response.reason == f"7 of {node.name}"


def test_service_of_the_station_answers_the_client(link: Link) -> None:
    link.station.serve("station/arm", SERVICES["arm"], _ok, direct=True)
    client = link.web.client("station/arm", SERVICES["arm"])
    assert client.wait(WAIT)
    assert client.call(new(REQUEST, request_id="1")).accepted


def test_a_request_sent_twice_takes_effect_once(link: Link) -> None:
    count = itertools.count(1)

    def handler(_request: Any) -> Any:
        return new(RESPONSE, accepted=True, reason=str(next(count)))

    link.vehicle.serve("once", SERVICES["arm"], Idempotent(handler))
    client = link.web.client("once", SERVICES["arm"])
    assert client.wait(WAIT)
    reasons = [client.call(new(REQUEST, request_id=i)).reason for i in ("a", "a", "b")]
    assert reasons == ["1", "1", "2"]


def test_the_kind_of_a_refusal_reaches_the_caller(link: Link) -> None:
    def refuses(_request: Any) -> Any:
        raise RefusedError("it moves still", Refusal.NOT_AT_REST)

    for service in ("start_behavior", "arm"):  # the answer of `arm` has no field for it
        link.vehicle.serve(f"{service}_of_a_kind", SERVICES[service], refuses)
    kinds = []
    for service in ("start_behavior", "arm"):
        client = link.web.client(f"{service}_of_a_kind", SERVICES[service])
        assert client.wait(WAIT)
        with pytest.raises(RefusedError, match="it moves still") as refused:
            client.ask("ada")
        kinds.append(refused.value.kind)
    assert kinds == [Refusal.NOT_AT_REST, Refusal.NONE]


def test_what_a_service_raises_reaches_the_caller_as_text(
    link: Link, caplog: pytest.LogCaptureFixture
) -> None:
    def refuses(_request: Any) -> Any:
        raise RefusedError("the motors are hot")

    def breaks(_request: Any) -> Any:
        raise KeyError("defect")

    link.vehicle.serve("refuses", SERVICES["arm"], refuses)
    link.vehicle.serve("breaks", SERVICES["arm"], breaks)
    refusing = link.web.client("refuses", SERVICES["arm"])
    assert refusing.wait(WAIT)
    answer = refusing.call(new(REQUEST))
    assert (answer.accepted, answer.reason) == (False, "the motors are hot")
    link.vehicle.serve("whoami_refuses", SERVICES["whoami"], refuses)
    plain = link.web.client("whoami_refuses", SERVICES["whoami"])
    assert plain.wait(WAIT)
    with pytest.raises(LinkError, match=r"^the motors are hot$"):
        plain.call(new(f"{SERVICES['whoami']}_Request"))
    assert "motors are hot" not in caplog.text  # not a defect: no traceback
    breaking = link.web.client("breaks", SERVICES["arm"])
    assert breaking.wait(WAIT)
    with pytest.raises(LinkError, match=r"defect of the vehicle.*KeyError"):
        breaking.call(new(REQUEST))
    assert "Traceback" in caplog.text


def test_a_service_that_is_slow_or_absent_is_a_link_error(link: Link) -> None:
    proceed = threading.Event()

    def slow(request: Any) -> Any:
        proceed.wait(WAIT)
        return _ok(request)

    link.vehicle.serve("slow", SERVICES["arm"], slow)
    client = link.web.client("slow", SERVICES["arm"])
    assert client.wait(WAIT)
    with pytest.raises(NoAnswerError, match=r"^the vehicle has not answered within 0\.2 s"):
        client.call(new(REQUEST), timeout=0.2)
    proceed.set()
    absent = link.web.client("absent", SERVICES["arm"])
    assert not absent.wait(0.05)
    with pytest.raises(UnreachableError, match=r"^the vehicle cannot be reached"):
        absent.call(new(REQUEST))


def test_a_service_that_is_lost_while_it_works_may_have_carried_it_out(link: Link) -> None:
    entered, proceed = threading.Event(), threading.Event()

    def slow(request: Any) -> Any:
        entered.set()
        proceed.wait(WAIT)
        return _ok(request)

    session = loopback_session(link.loopback_port)
    Node(session, "/quad1", "leaving").serve("leaving", SERVICES["arm"], slow)
    client = link.web.client("leaving", SERVICES["arm"])
    assert client.wait(WAIT)

    def leave() -> None:
        entered.wait(WAIT)
        threading.Event().wait(0.2)  # it breaks after an absent service is detected
        session.close()

    leaving = threading.Thread(target=leave)
    leaving.start()
    with pytest.raises(NoAnswerError, match=r"^contact with the vehicle broke before") as found:
        client.call(new(REQUEST), timeout=WAIT)
    assert not isinstance(found.value, UnreachableError)
    proceed.set()
    leaving.join()


def test_a_question_on_its_way_while_its_service_closes_is_a_link_error(
    link: Link, caplog: pytest.LogCaptureFixture
) -> None:
    leaving = Node(link.vehicle.session, "/quad1", "leaving")
    leaving.serve("leaving", SERVICES["arm"], _ok, at_once=2)
    client = link.web.client("leaving", SERVICES["arm"])
    assert client.wait(WAIT)
    leaving._is_closing = True  # closed, with the request not yet stopped
    leaving._pool.shutdown()
    with caplog.at_level("DEBUG"), pytest.raises(LinkError, match="the vehicle is closing"):
        client.call(new(REQUEST), WAIT)
    assert "leaving was asked while it closes" in caplog.text
    assert "Traceback" not in caplog.text
    leaving.close()


@pytest.mark.parametrize("service", ["of_two", "of_one"])
def test_a_request_that_is_held_up_delays_no_other(link: Link, service: str) -> None:
    """Requests to the other threads of a service of several, and to another service."""
    entered, proceed = threading.Event(), threading.Event()

    def hold_up(request: Any) -> Any:
        if request.request_id == "land":
            entered.set()
            proceed.wait(WAIT)
        return _ok(request)

    several = service == "of_two"
    link.vehicle.serve(service, SERVICES["arm"], hold_up, at_once=2 if several else 1)
    link.vehicle.serve(f"beside_{service}", SERVICES["arm"], _ok)
    held_up = link.web.client(service, SERVICES["arm"])
    other = held_up if several else link.web.client(f"beside_{service}", SERVICES["arm"])
    assert held_up.wait(WAIT)
    assert other.wait(WAIT)
    answers: list[Any] = []
    landing = new(REQUEST, request_id="land")
    thread = threading.Thread(target=lambda: answers.append(held_up.call(landing, WAIT)))
    thread.start()
    assert entered.wait(WAIT)
    assert other.call(new(REQUEST, request_id="cut"), WAIT).accepted
    assert not answers
    proceed.set()
    thread.join(WAIT)
    assert answers[0].accepted


def test_clock_offset_is_found_through_the_link(link: Link) -> None:
    ahead = 3_600_000_000_000
    serve_time_sync(link.vehicle, clock=lambda: time.time_ns() + ahead)
    client = link.station.client("time_sync", SERVICES["time_sync"])
    assert client.wait(WAIT)
    best = min((exchange(client) for _ in range(5)), key=lambda one: one.round_trip_ns)
    assert 0 < best.round_trip_ns < 1_000_000_000
    assert abs(best.offset_ns - ahead) <= best.round_trip_ns // 2


class _Gains(Parameters):
    kp: float = parameter(3.0, description="gain", unit="1/s²", ge=0.0, le=20.0, step=0.1)
    laps: int = parameter(2, description="laps", ge=1, le=9)
    law: str = parameter("so3", description="law", choices=("so3", "hover"))
    on: bool = parameter(True, description="switch")


class _Root(Parameters):
    position: _Gains = _Gains()
    model: VehicleModel = VehicleModel()


class Authority:
    """Store behind the services, as on the vehicle."""

    def __init__(self) -> None:
        self.store = ParameterStore(_Root(position=_Gains(), model=VehicleModel()))
        self.requesters: list[str] = []

    def descriptions(self) -> Sequence[ParameterDescription]:
        return self.store.descriptions()

    def values(self) -> Mapping[str, ParameterValue]:
        return self.store.values()

    def change(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> tuple[Mapping[str, ParameterValue], int]:
        self.requesters.append(requester)
        return self.store.set(values), self.store.revision


@pytest.fixture(scope="module")
def authority(link: Link) -> Authority:
    authority = Authority()
    serve_parameters(link.vehicle, authority)
    # All six are available before a test depends on one of them.
    request = "rcl_interfaces/srv/SetParameters"
    assert link.web.client("vehicle/set_parameters", request).wait(WAIT)
    describe = "rcl_interfaces/srv/DescribeParameters"
    assert link.web.client("vehicle/describe_parameters", describe).wait(WAIT)
    return authority


@pytest.fixture
def parameters(link: Link, authority: Authority) -> ParameterClient:
    del authority
    return ParameterClient(link.web, "vehicle")


def test_parameters_and_their_descriptions_cross_the_link_exactly(
    authority: Authority, parameters: ParameterClient
) -> None:
    assert parameters.names() == list(authority.store.names)
    assert parameters.values() == authority.store.values()
    assert tuple(parameters.describe()) == authority.store.descriptions()


def test_parameters_are_set_together(authority: Authority, parameters: ParameterClient) -> None:
    values: dict[str, ParameterValue] = {
        "position.kp": 4.5,
        "position.laps": 3,
        "position.law": "hover",
        "position.on": False,
    }
    parameters.set(values)
    assert {name: authority.store.get(name) for name in values} == values
    assert parameters.values()["position.kp"] == 4.5


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("position.kpp", 1.0, "unknown parameter 'position.kpp': did you mean position.kp"),
        ("position.kp", math.nan, "position.kp = nan is not a finite number; allowed 0 to 20"),
        ("position.kp", 20.5, "position.kp = 20.5 is out of bounds; allowed 0 to 20 1/s²"),
        ("position.kp", "fast", "position.kp must be a number, not 'fast'"),
        ("position.kp", True, "position.kp must be a number, not True"),
        ("position.law", "pid", "position.law = 'pid' is not one of so3, hover"),
    ],
)
def test_a_bad_value_comes_back_with_the_authoritys_words(
    authority: Authority, parameters: ParameterClient, name: str, value: ParameterValue, reason: str
) -> None:
    before = authority.store.values()
    with pytest.raises(ParameterError) as refused:
        parameters.set({"position.laps": 4, name: value})
    assert str(refused.value).startswith(reason)
    assert authority.store.values() == before  # all or nothing


def test_ros_sets_each_parameter_on_its_own(link: Link, authority: Authority) -> None:
    client = link.web.client("vehicle/set_parameters", "rcl_interfaces/srv/SetParameters")
    request = new(
        "rcl_interfaces/srv/SetParameters_Request",
        parameters=[
            *to_parameters({"position.kp": 7.0, "position.laps": 99}),
            new("rcl_interfaces/Parameter", name="position.on", value={"type": 8}),
        ],
    )
    results = client.call(request).results
    assert [r.successful for r in results] == [True, False, False]
    assert "out of bounds" in results[1].reason
    assert "array" in results[2].reason
    assert authority.store.get("position.kp") == 7.0
    assert authority.requesters[-1] == "ros2 param"


def test_ros_gets_types_lists_and_unset_values(link: Link, authority: Authority) -> None:
    del authority
    types = link.web.client("vehicle/get_parameter_types", "rcl_interfaces/srv/GetParameterTypes")
    names = ["position.on", "position.laps", "position.kp", "position.law", "nothing"]
    request = new("rcl_interfaces/srv/GetParameterTypes_Request", names=names)
    assert types.call(request).types.tolist() == [1, 2, 3, 4, 0]
    get = link.web.client("vehicle/get_parameters", "rcl_interfaces/srv/GetParameters")
    wanted = new("rcl_interfaces/srv/GetParameters_Request", names=["nothing", "model.arm"])
    unset, arm = get.call(wanted).values
    assert (unset.type, from_value(arm)) == (0, 0.25)
    listing = link.web.client("vehicle/list_parameters", "rcl_interfaces/srv/ListParameters")
    below = new("rcl_interfaces/srv/ListParameters_Request", prefixes=["position"], depth=1)
    result = listing.call(below).result
    assert result.names == [f"position.{field}" for field in _Gains.model_fields]
    assert result.prefixes == ["position"]
    below = new("rcl_interfaces/srv/ListParameters_Request", depth=1)
    assert listing.call(below).result.names == []


def test_ros_tools_find_node_topic_and_service(link: Link) -> None:
    link.vehicle.advertise(TOPICS["status"])
    link.vehicle.serve("found", SERVICES["arm"], _ok)
    assert link.web.client("found", SERVICES["arm"]).wait(WAIT)
    replies = link.web.session.liveliness().get("@ros2_lv/0/**", timeout=WAIT)
    tokens = [str(reply.ok.key_expr) for reply in replies if reply.ok]
    assert any("/NN/%/%quad1/vehicle" in token for token in tokens)
    assert any("/MP/%/%quad1/vehicle/%quad1%status/" in token for token in tokens)
    assert any("/SS/%/%quad1/vehicle/%quad1%found/" in token for token in tokens)
    numbers = [token.split("/")[4] for token in tokens if "/%quad1/vehicle" in token]
    assert len(set(numbers)) == len(numbers)  # one counter a session


def test_a_closed_node_is_heard_and_served_no_more(link: Link) -> None:
    node = Node(link.vehicle.session, "quad1", "shortlived")
    assert node.full_name == "/quad1/shortlived"
    node.serve("gone", SERVICES["arm"], _ok)
    client = link.station.client("gone", SERVICES["arm"])
    assert client.wait(WAIT)
    node.close()
    deadline = time.monotonic() + WAIT
    while client.wait(0.0):  # until the withdrawal has crossed the link
        assert time.monotonic() < deadline
    with pytest.raises(UnreachableError):
        client.call(new(REQUEST))


def test_the_link_is_quic(link: Link) -> None:
    others = [str(one.dst) for one in link.vehicle.session.info.links()]
    assert others
    assert all(other.startswith("quic/127.0.0.1:") for other in others), others
    hub = [str(one.dst).split("?")[0] for one in link.web.session.info.links()]
    assert hub == [f"tcp/127.0.0.1:{link.loopback_port}"]


def test_a_port_in_use_is_one_line(link: Link) -> None:
    with pytest.raises(LinkError, match=rf"^UDP port {link.vehicle_port} .*in use; stop .*$"):
        vehicle_session(link.vehicle_port, link.tls)
    with pytest.raises(LinkError, match=rf"^TCP port {link.loopback_port} .*in use; stop .*$"):
        hub_session(link.loopback_port)


def test_a_station_with_a_foreign_certificate_is_not_let_in(link: Link, tmp_path: Path) -> None:
    foreign = ensure_certificates(tmp_path)
    station = StationLink(link.vehicle_port, foreign)
    try:
        assert not station.wait(1.5)
    finally:
        station.close()


def test_certificates_are_checked_before_dialling(link: Link, tmp_path: Path) -> None:
    with pytest.raises(LinkError, match=r"not for 10\.9\.8\.7"):
        check_station("10.9.8.7", link.tls)
    with pytest.raises(LinkError, match=r"ca\.pem is missing; copy it back"):
        vehicle_session(free_port(socket.SOCK_DGRAM), TlsFiles(tmp_path))


def test_a_client_without_a_station_says_what_to_start() -> None:
    port = free_port(socket.SOCK_STREAM)
    with pytest.raises(LinkError, match=r"no station answered .* within 0\.2 s; start it"):
        loopback_session(port, timeout=0.2)


def test_a_client_comes_back_after_the_stations_restart(link: Link) -> None:
    station = StationLink(link.vehicle_port, link.tls)
    web = loopback_session(station.loopback_port)
    try:
        client = Node(web, "/quad1", "patient").client("back", SERVICES["arm"])
        link.vehicle.serve("back", SERVICES["arm"], _ok)
        assert client.wait(WAIT)
        station.close()
        deadline = time.monotonic() + WAIT
        while client.wait(0.0):  # until the client has noticed
            assert time.monotonic() < deadline
        station = StationLink(link.vehicle_port, link.tls, station.loopback_port)
        assert client.wait(WAIT)
        assert client.call(new(REQUEST, request_id="3")).accepted
    finally:
        web.close()
        station.close()


def test_a_closed_session_is_a_link_error(link: Link) -> None:
    session = loopback_session(link.loopback_port)
    node = Node(session, "/quad1", "leaving")
    publisher = node.advertise(heartbeats("x"))
    client = node.client("arm", SERVICES["arm"])
    session.close()
    with pytest.raises(LinkError, match="session is closed"):
        publisher.put(b"")
    with pytest.raises(LinkError, match="the vehicle cannot be asked"):
        client.call(new(REQUEST))
    with pytest.raises(LinkError, match="cannot announce"):
        Node(session, "/quad1", "late")
    node.close()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("quad1.local", ("quad1.local", 7447)),
        ("192.168.4.2:8000", ("192.168.4.2", 8000)),
        ("quic/192.168.4.2:8000?mixed_rel=1", ("192.168.4.2", 8000)),
        ("[fe80::1]:8000", ("fe80::1", 8000)),
        ("[fe80::1]", ("fe80::1", 7447)),
    ],
)
def test_endpoints_are_read(text: str, expected: tuple[str, int]) -> None:
    assert parse_endpoint(text) == expected


@pytest.mark.parametrize("text", ["", ":7447", "quad1:", "quad1:http", "quad1:99999"])
def test_an_endpoint_that_cannot_be_read_is_a_usage_error(text: str) -> None:
    with pytest.raises(UsageError, match="is not the address of a vehicle"):
        parse_endpoint(text)


def test_ticks_have_the_longest_queue_of_a_session() -> None:
    """A page shows each tick as missing that a session drops."""
    sizes = link_config("router")["transport"]["link"]["tx"]["queue"]["size"]
    assert sizes[TOPICS["ticks"].priority] == max(sizes.values())
