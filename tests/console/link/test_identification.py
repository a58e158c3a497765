"""Identification of the vehicle at the other end, and the report when nothing answers.

The sessions and the radio are real.
"""

from __future__ import annotations

import math
import shutil
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from console.link import identification
from console.link.identification import PERIOD, VehicleIdentification
from console.link.monitor import LinkMonitor
from console.rounds import run_rounds
from tests.waiting import free_port
from vehicle_link.identity import THE_ONE
from vehicle_link.security.authority import Role, TlsFiles, ensure_certificates
from vehicle_link.security.enrolment import issue_station
from vehicle_link.transport import radio, whoami
from vehicle_link.transport.node import Node
from vehicle_link.transport.radio import Radio
from vehicle_link.transport.session import hub_session, vehicle_session
from vehicle_link.transport.whoami import serve_whoami

WAIT = 10.0  # s: a bound, not an expectation


class Station:
    """Station with one hub, one radio and the thread that asks."""

    def __init__(self, port: int, tls: TlsFiles, silent: float = 0.0) -> None:
        loopback = free_port(socket.SOCK_STREAM)
        self.hub: Any = hub_session(loopback)
        self.link = LinkMonitor("quad1", 1)
        self.link.follow(Radio(f"127.0.0.1:{port}", tls, loopback, lambda: silent))
        asks = VehicleIdentification(Node(self.hub, "/quad1", "station"), "quad1", self.link)
        self._closing = threading.Event()
        turns = {asks.update: PERIOD}, self._closing, lambda act: act()
        self._thread = threading.Thread(target=run_rounds, args=turns)
        self._thread.start()

    @property
    def told(self) -> str:
        """Return what pages receive."""
        return str(self.link.message(time.time_ns()).problem)

    def until(self, condition: Callable[[LinkMonitor], object]) -> None:
        deadline = time.monotonic() + WAIT
        while not condition(self.link):
            assert time.monotonic() < deadline
            time.sleep(0.01)

    def close(self) -> None:
        self._closing.set()
        self._thread.join()
        assert self.link.radio
        self.link.radio.close(WAIT)
        self.hub.close()


@pytest.fixture
def closed() -> Iterator[list[Any]]:
    """Yield a list of things to close, and close them, the last first."""
    things: list[Any] = []
    yield things
    while things:
        things.pop().close()


@pytest.fixture(autouse=True)
def _impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seconds in (("PERIOD", 0.02), ("REPEAT", 0.1), ("SILENT_FOR", 0.1)):
        monkeypatch.setattr(identification, name, seconds)


def _vehicle(closed: list[Any], port: int, tls: TlsFiles, name: str = "quad1") -> Node:
    closed.append(vehicle_session(port, tls, "127.0.0.1"))
    closed.append(Node(closed[-1], f"/{name}", "vehicle"))  # closed with the last one that holds it
    return closed[-1]  # type: ignore[no-any-return]


def _station(closed: list[Any], port: int, tls: TlsFiles, silent: float = 0.0) -> Station:
    closed.append(Station(port, tls, silent))
    return closed[-1]  # type: ignore[no-any-return]


def test_a_vehicle_says_what_we_may_and_is_forgotten_when_it_goes(
    tmp_path: Path, closed: list[Any]
) -> None:
    tls, port = ensure_certificates(tmp_path), free_port(socket.SOCK_DGRAM)
    station = _station(closed, port, tls)
    vehicle: Any = vehicle_session(port, tls, "127.0.0.1")
    serve_whoami(Node(vehicle, "/quad1", "vehicle"), "quad1", 5, THE_ONE)
    station.until(lambda link: link.permission.access == "pilot" and not link.problem())
    message = station.link.message(time.time_ns())
    assert (message.address, message.access) == (f"127.0.0.1:{port}", "pilot")
    vehicle.close()
    station.until(lambda link: link.permission.access == "")


def test_an_observer_is_told_that_it_is_one(tmp_path: Path, closed: list[Any]) -> None:
    tls, port = ensure_certificates(tmp_path / "base"), free_port(socket.SOCK_DGRAM)
    serve_whoami(_vehicle(closed, port, tls), "quad1", 5, THE_ONE)
    ben = issue_station(tls.folder, tmp_path / "ben", "ben", "observer")
    station = _station(closed, port, ben)
    station.until(lambda link: link.permission.access == "observer")
    assert "observe quad1, not command" in station.link.problem()


def test_another_protocol_is_a_problem(
    tmp_path: Path, closed: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    tls, port = ensure_certificates(tmp_path), free_port(socket.SOCK_DGRAM)
    monkeypatch.setattr(whoami, "protocol", lambda: "00000000")
    monkeypatch.setattr(whoami, "version", lambda: "99.0")
    serve_whoami(_vehicle(closed, port, tls), "quad1", 5, THE_ONE)
    station = _station(closed, port, tls)
    station.until(lambda link: "speaks protocol 00000000 (quadlab 99.0)" in link.problem())
    assert station.link.problem().endswith("update quadlab on the station")


def test_a_vehicle_that_does_not_understand_the_question_is_of_another_version(
    tmp_path: Path, closed: list[Any]
) -> None:
    tls, port = ensure_certificates(tmp_path), free_port(socket.SOCK_DGRAM)
    _vehicle(closed, port, tls)
    station = _station(closed, port, tls)
    station.until(lambda link: "runs another version of quadlab (" in link.problem())


def test_a_vehicle_of_another_name_is_told_by_its_name(tmp_path: Path, closed: list[Any]) -> None:
    tls, port = ensure_certificates(tmp_path), free_port(socket.SOCK_DGRAM)
    serve_whoami(_vehicle(closed, port, tls, "quad7"), "quad7", 5, THE_ONE)
    station = _station(closed, port, tls)
    told = "is called quad7, not quad1: start it with --name quad1"
    station.until(lambda link: told in link.problem())


def test_no_link_is_told_with_its_likely_cause(tmp_path: Path, closed: list[Any]) -> None:
    tls, port = ensure_certificates(tmp_path / "ours"), free_port(socket.SOCK_DGRAM)
    station = _station(closed, port, tls)
    station.until(lambda link: "no `quadlab vehicle` listens" in link.permission.unreachable_reason)
    _vehicle(closed, port, ensure_certificates(tmp_path / "foreign"))
    station.until(
        lambda link: "not accept the other's certificate" in link.permission.unreachable_reason
    )
    assert station.link.problem() == ""
    assert station.told == station.link.permission.unreachable_reason


def test_a_vehicle_s_certificate_at_the_station_is_told_until_the_right_one_is_there(
    tmp_path: Path, closed: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(radio, "REOPEN_AFTER", 0.3)
    monkeypatch.setattr(identification, "DOWN_FOR", 60.0)  # however slowly it is opened again
    ours, port = ensure_certificates(tmp_path / "base"), free_port(socket.SOCK_DGRAM)
    serve_whoami(_vehicle(closed, port, ours), "quad1", 5, THE_ONE)
    wrong = TlsFiles(tmp_path / "wrong")
    shutil.copytree(ours.folder, wrong.folder)
    _copy_pair(ours, "vehicle", wrong)
    station = _station(closed, port, wrong, silent=math.inf)
    station.until(lambda link: "sends nothing to this station: its certificate" in station.told)
    dialled = station.link.radio
    assert dialled
    told: set[str] = set()
    enough = dialled.reopened + 2

    def is_reopened_again(_: LinkMonitor) -> bool:
        told.add(station.told)
        return dialled.reopened >= enough

    station.until(is_reopened_again)
    assert told == {station.told}
    _copy_pair(ours, "station", wrong)
    station.until(lambda link: link.permission.access == "pilot" and not station.told)


def test_a_certificate_of_another_authority_is_told_by_its_file_until_it_is_ours(
    tmp_path: Path, closed: list[Any]
) -> None:
    ours, port = ensure_certificates(tmp_path / "ours"), free_port(socket.SOCK_DGRAM)
    kept, foreign = TlsFiles(tmp_path / "kept"), ensure_certificates(tmp_path / "foreign")
    shutil.copytree(ours.folder, kept.folder)
    station = _station(closed, port, ours)
    station.until(lambda link: "no `quadlab vehicle` listens" in station.told)
    _copy_pair(foreign, "station", ours)
    path = ours.certificate("station")
    reason = f"no link to 127.0.0.1:{port}: {path} was not signed by {ours.authority}; copy "
    station.until(lambda link: station.told.startswith(reason))
    _copy_pair(kept, "station", ours)
    serve_whoami(_vehicle(closed, port, kept), "quad1", 5, THE_ONE)
    station.until(lambda link: link.permission.access == "pilot" and not station.told)


def _copy_pair(source: TlsFiles, role: Role, to: TlsFiles) -> None:
    """Copy a certificate and key over the station's."""
    shutil.copy(source.certificate(role), to.certificate("station"))
    shutil.copy(source.key(role), to.key("station"))
