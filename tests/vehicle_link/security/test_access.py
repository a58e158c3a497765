"""Access of pilots, observers and strangers to a vehicle: real sessions, real certificates."""

from __future__ import annotations

import datetime
import queue
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from quadrotor.errors import LinkError, UnreachableError
from tests.support.subscribers import has_subscriber
from tests.waiting import free_port, wait_for
from vehicle_link.identity import THE_ONE
from vehicle_link.messages import new
from vehicle_link.security import authority
from vehicle_link.security.authority import ROLES, TlsFiles, check_certificate, ensure_certificates
from vehicle_link.security.certificates import certificate_builder, load_certificate
from vehicle_link.security.enrolment import issue_station, issue_vehicle
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.protocol import disagreement, protocol, version
from vehicle_link.transport.publisher import Received
from vehicle_link.transport.radio import Radio
from vehicle_link.transport.session import hub_session, vehicle_session
from vehicle_link.transport.time_sync import TIME_SYNC, serve_time_sync
from vehicle_link.transport.whoami import WhoAmI, serve_whoami

WAIT = 10.0  # s: a bound, not an expectation
ARM = SERVICES["arm"]
UP = ("tracker_pose", "bearings", "joy", "station_heartbeat")


@dataclass
class Door:
    """A vehicle of a base, and the stations that a test connects to it."""

    base: Path
    port: int
    vehicle: Node
    heard: queue.SimpleQueue[tuple[str, bytes]]
    closed: list[Callable[[], None]]

    def station(self, tls: TlsFiles) -> tuple[Node, Radio]:
        loopback = free_port(socket.SOCK_STREAM)
        hub: Any = hub_session(loopback)
        radio = Radio(f"127.0.0.1:{self.port}", tls, loopback, lambda: 0.0)
        self.closed += [hub.close, lambda: radio.close(WAIT)]
        return Node(hub, "/quad1", "station"), radio


@pytest.fixture
def door(tmp_path: Path) -> Iterator[Door]:
    base, port = tmp_path / "base", free_port(socket.SOCK_DGRAM)
    tls = issue_vehicle(base, tmp_path / "vehicle", "quad1", ["quad1.local"])
    session: Any = vehicle_session(port, tls, "127.0.0.1")
    node = Node(session, "/quad1", "vehicle")
    made = Door(base, port, node, queue.SimpleQueue(), [session.close])
    for name in UP:
        row = TOPICS[name]

        def heard(received: Received, name: str = name) -> None:
            made.heard.put((name, received.payload))

        node.subscribe(name, row.type_name, heard, qos=row.qos)
    node.serve("arm", ARM, lambda request: new(f"{ARM}_Response", accepted=True))
    serve_time_sync(node, lambda: 5)
    serve_whoami(node, "quad1", 77, THE_ONE)
    yield made
    while made.closed:
        made.closed.pop()()


def _hears_status(station: Node, vehicle: Node) -> bool:
    """Send until received, because datagrams may start a little later than the link."""
    row, got = TOPICS["status"], threading.Event()
    station.subscribe(row.name, row.type_name, lambda received: got.set())
    publisher = vehicle.advertise(row)
    wait_for(lambda: publisher.put(b"") or got.is_set())  # type: ignore[func-returns-value]
    return True


def test_a_pilot_hears_and_commands(door: Door, tmp_path: Path) -> None:
    station, _ = door.station(issue_station(door.base, tmp_path / "ada", "ada", "pilot"))
    assert _hears_status(station, door.vehicle)
    for name in UP:
        sent = station.advertise(TOPICS[name])
        assert has_subscriber(sent, WAIT)
        sent.put(name.encode())
        assert door.heard.get(timeout=WAIT) == (name, name.encode())
    client = station.client("arm", ARM)
    assert client.wait(WAIT)
    assert client.call(new(f"{ARM}_Request")).accepted
    answer = WhoAmI(station).ask()
    assert (answer.access, answer.name, answer.instance) == ("pilot", "quad1", 77)
    assert (answer.protocol, answer.version) == (protocol(), version())
    assert (answer.robot_id, answer.firmware) == (THE_ONE.robot_id, THE_ONE.firmware)


def test_the_certificates_a_base_has_had_are_a_pilots(door: Door) -> None:
    station, _ = door.station(ensure_certificates(door.base))
    assert station.client("time_sync", TIME_SYNC).wait(WAIT)
    assert WhoAmI(station).ask().access == "pilot"


def test_an_observer_hears_and_changes_nothing(door: Door, tmp_path: Path) -> None:
    station, _ = door.station(issue_station(door.base, tmp_path / "ben", "ben", "observer"))
    assert _hears_status(station, door.vehicle)
    clock = station.client("time_sync", TIME_SYNC)
    assert clock.wait(WAIT)
    answer = WhoAmI(station).ask()
    assert answer.access == "observer"
    assert answer.protocol == protocol()
    for name in UP:
        station.advertise(TOPICS[name]).put(b"no")
    # Wait until both have found each other: a known key need not be announced.
    clients = [station.client(name, ARM) for name in ("arm", "disarm")]
    for client in clients:
        with pytest.raises(UnreachableError):
            client.call(new(f"{ARM}_Request"))
    clock.call(new(f"{TIME_SYNC}_Request"))  # earlier messages have arrived by then
    assert door.heard.empty()


def test_a_vehicles_certificate_opens_no_other_vehicle(door: Door, tmp_path: Path) -> None:
    stolen = issue_vehicle(door.base, tmp_path / "stolen", "quad2", [])
    stolen.certificate("vehicle").rename(stolen.certificate("station"))
    stolen.key("vehicle").rename(stolen.key("station"))
    station, radio = door.station(stolen)
    assert radio.wait(WAIT)
    assert radio.names() == set()
    with pytest.raises(LinkError, match="does not identify itself"):
        WhoAmI(station).ask()


def test_an_ended_certificate_is_told_at_the_start_of_either_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    base, now = ensure_certificates(tmp_path / "base").folder, datetime.datetime.now(datetime.UTC)
    for name, days in (("ended", (-9, -1)), ("not yet", (1, 9))):
        begin, end = (now + datetime.timedelta(days=day) for day in days)
        builder = partial(certificate_builder, begin=begin, end=end)
        with monkeypatch.context() as patched:
            patched.setattr(authority, "certificate_builder", builder)
            vehicle = issue_vehicle(base, tmp_path / f"{name} vehicle", "quad1", [])
            station = issue_station(base, tmp_path / f"{name} ben", "ben", "pilot")
        told = r"is valid from .*, and the clock says .* UTC; set the clock, or copy"
        with pytest.raises(LinkError, match=rf"vehicle\.pem {told}"):
            vehicle_session(free_port(socket.SOCK_DGRAM), vehicle, "127.0.0.1")
        with pytest.raises(LinkError, match=rf"station\.pem {told}"):
            Radio("127.0.0.1", station, free_port(socket.SOCK_STREAM), lambda: 0.0)


def test_a_certificate_is_good_by_a_clock_that_is_years_behind(tmp_path: Path) -> None:
    tls = ensure_certificates(tmp_path)
    for role in ROLES:
        begin = load_certificate(tls.certificate(role)).not_valid_before_utc
        assert begin == datetime.datetime(2020, 1, 1, tzinfo=datetime.UTC)


def test_a_radio_sees_the_name_of_its_vehicle(door: Door) -> None:
    _, radio = door.station(ensure_certificates(door.base))
    assert radio.wait(WAIT)
    wait_for(lambda: radio.names() == {"quad1"})


def test_certificates_for_others_are_whole_and_never_hold_the_authoritys_key(
    tmp_path: Path,
) -> None:
    base = tmp_path / "base"
    vehicle = issue_vehicle(base, tmp_path / "vehicle", "quad1", ["quad1.local", "10.0.0.7"])
    check_certificate(vehicle, "vehicle", "10.0.0.7")
    check_certificate(vehicle, "vehicle", "quad1.local")
    with pytest.raises(LinkError, match=r"not for 10\.0\.0\.8"):
        check_certificate(vehicle, "vehicle", "10.0.0.8")
    assert {path.name for path in vehicle.folder.iterdir()} == {
        "ca.pem",
        "vehicle.pem",
        "vehicle.key",
    }
    assert all(path.stat().st_mode & 0o077 == 0 for path in vehicle.folder.iterdir())
    with pytest.raises(LinkError, match=r"no authority's key .*; issue certificates on the base"):
        issue_station(vehicle.folder, tmp_path / "x", "x", "pilot")


@pytest.mark.parametrize(
    ("theirs", "remedy"),
    [("0.0.9", "update quadlab on the vehicle"), ("99.1", "update quadlab on the station")],
)
def test_another_protocol_is_told_with_the_end_to_update(theirs: str, remedy: str) -> None:
    line = disagreement("00000000", theirs)
    assert "protocol 00000000" in line
    assert protocol() in line
    assert line.endswith(remedy)


def test_one_protocol_is_no_disagreement_whatever_the_version() -> None:
    assert disagreement(protocol(), "99.1") == ""
    assert disagreement("00000000", version()).endswith(
        "install the same version of quadlab on both"
    )
