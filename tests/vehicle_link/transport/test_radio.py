"""Station with a hub and radios: real sessions on loopback."""

from __future__ import annotations

import math
import queue
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from quadrotor.errors import LinkError, UsageError
from tests.waiting import free_port, wait_for
from vehicle_link.messages import new
from vehicle_link.security.authority import TlsFiles, ensure_certificates
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport import radio
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received
from vehicle_link.transport.radio import Radio
from vehicle_link.transport.session import hub_session, vehicle_session

WAIT = 10.0  # s: a bound, not an expectation
ARM = SERVICES["arm"]


class Vehicle:
    """Node that sends a status every 20 ms until it is muted."""

    def __init__(self, tls: TlsFiles, name: str) -> None:
        self.port = free_port(socket.SOCK_DGRAM)
        self.session: Any = vehicle_session(self.port, tls, "127.0.0.1")
        self.node = Node(self.session, f"/{name}", "vehicle")
        self.talks, self.closing = threading.Event(), threading.Event()
        self.talks.set()
        self._publisher = self.node.advertise(TOPICS["status"])
        self.node.serve("arm", ARM, lambda request: new(f"{ARM}_Response", accepted=True))
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self.closing.wait(0.02):
            if self.talks.is_set():
                self._publisher.put(b"")

    def close(self) -> None:
        self.closing.set()
        self._thread.join()
        self.session.close()


@dataclass
class Lab:
    """A hub, and what a test adds; closed in the end."""

    tls: TlsFiles
    port: int = field(default_factory=lambda: free_port(socket.SOCK_STREAM))
    closed: list[Callable[[], None]] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.hub = hub_session(self.port)
        self.closed.append(self.hub.close)

    def vehicle(self, name: str) -> Vehicle:
        made = Vehicle(self.tls, name)
        self.closed.append(made.close)
        return made

    def radio(
        self, vehicle: Vehicle, heard: Heard, answers: Callable[[float], bool] = bool
    ) -> Radio:
        made = Radio(
            f"127.0.0.1:{vehicle.port}",
            self.tls,
            self.port,
            heard.silent,
            report=self.said.append,
            probe=answers,
        )
        self.closed.append(lambda: made.close(WAIT))
        return made


class Heard:
    """Statuses of a vehicle that a node of the hub receives."""

    def __init__(self, session: Any, name: str) -> None:
        self.messages: queue.SimpleQueue[Received] = queue.SimpleQueue()
        self.newest = -float("inf")
        row = TOPICS["status"]
        self.node = Node(session, f"/{name}", "listener")
        self.node.subscribe(row.name, row.type_name, self._heard, qos=row.qos)

    def _heard(self, received: Received) -> None:
        self.newest = time.monotonic()
        self.messages.put(received)

    def silent(self) -> float:
        return time.monotonic() - self.newest


@pytest.fixture(scope="module")
def tls(tmp_path_factory: pytest.TempPathFactory) -> TlsFiles:
    return ensure_certificates(tmp_path_factory.mktemp("tls"))


@pytest.fixture
def lab(tls: TlsFiles) -> Iterator[Lab]:
    made = Lab(tls)
    yield made
    while made.closed:
        made.closed.pop()()


def test_a_vehicle_is_heard_and_commanded_from_the_hub_and_from_its_clients(lab: Lab) -> None:
    vehicle = lab.vehicle("quad1")
    web = loopback_session(lab.port)
    lab.closed.append(web.close)
    heard = [Heard(lab.hub, "quad1"), Heard(web, "quad1")]
    dialled = lab.radio(vehicle, heard[0])
    assert dialled.wait(WAIT)
    assert dialled.address == f"127.0.0.1:{vehicle.port}"
    for each in heard:
        assert each.messages.get(timeout=WAIT).payload == b""
        client = each.node.client("arm", ARM)
        assert client.wait(WAIT)
        assert client.call(new(f"{ARM}_Request")).accepted


def test_each_vehicle_has_a_radio_of_its_own(lab: Lab) -> None:
    vehicles = {name: lab.vehicle(name) for name in ("quad1", "quad2")}
    heard = {name: Heard(lab.hub, name) for name in vehicles}
    radios = {name: lab.radio(vehicle, heard[name]) for name, vehicle in vehicles.items()}
    for each in heard.values():
        each.messages.get(timeout=WAIT)
    radios["quad1"].close(WAIT)
    wait_for(lambda: heard["quad1"].silent() > 0.2)
    assert heard["quad2"].silent() < 0.2
    assert radios["quad2"].connected


def test_a_link_that_stands_but_is_deaf_is_opened_anew_with_patience(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(radio, "REOPEN_AFTER", 0.3)
    vehicle = lab.vehicle("quad1")
    other = lab.vehicle("quad2")
    heard, beside = Heard(lab.hub, "quad1"), Heard(lab.hub, "quad2")
    dialled, _ = lab.radio(vehicle, heard), lab.radio(other, beside)
    heard.messages.get(timeout=WAIT)
    beside.messages.get(timeout=WAIT)
    assert dialled.reopened == 0
    vehicle.talks.clear()  # its session continues, but nothing is sent over it
    wait_for(lambda: dialled.reopened == 2)
    assert lab.said == [
        f"the link to {dialled.address} is open but delivered nothing for {patience} s: reopened"
        for patience in ("0.3", "0.6")
    ]
    assert beside.silent() < 0.3  # no other was affected
    vehicle.talks.set()
    wait_for(lambda: heard.silent() < 0.1)
    assert dialled.wait(WAIT)


@pytest.mark.parametrize("answers", [True, False])
def test_a_session_that_sleeps_on_after_an_outage_is_opened_anew_at_once(
    lab: Lab, answers: bool
) -> None:
    vehicle, asked = lab.vehicle("quad1"), threading.Event()
    heard = Heard(lab.hub, "quad1")

    def ask(within: float) -> bool:
        assert within == radio.ANSWER_WITHIN
        asked.set()
        return answers

    dialled = lab.radio(vehicle, heard, ask)
    heard.messages.get(timeout=WAIT)
    wait_for(lambda: dialled.connected_for > 2.0 * radio.OUTAGE_AFTER)
    assert not asked.is_set()
    vehicle.talks.clear()  # the link stays up in the meantime
    wait_for(lambda: heard.silent() > 1.5 * radio.OUTAGE_AFTER)
    assert not asked.is_set()
    vehicle.talks.set()
    assert asked.wait(WAIT)
    wait_for(lambda: dialled.reopened == (not answers))
    asked.clear()
    wait_for(lambda: dialled.connected_for > 2.0 * radio.LOOK)
    assert (asked.is_set(), dialled.reopened) == (False, not answers)
    assert lab.said == []


@pytest.mark.parametrize(
    ("unheard", "lasted"),
    [
        ([0.0, 0.5, 0.9, 0.1, 0.1], [0.0, 0.0, 0.0, 0.9, 0.0]),
        ([0.1, 0.39, 0.1], [0.0, 0.0, 0.0]),
        ([math.inf, 0.1], [0.0, math.inf]),
    ],
    ids=["told once", "too short", "never heard before"],
)
def test_an_outage_is_over_when_anything_is_heard(
    unheard: list[float], lasted: list[float]
) -> None:
    outage = radio.OutageDetector()
    assert [outage.ended(each) for each in unheard] == lasted


def test_a_radio_waits_for_its_vehicle_and_its_hub_for_neither(lab: Lab) -> None:
    heard = Heard(lab.hub, "quad1")
    port = free_port(socket.SOCK_DGRAM)
    dialled = Radio(f"127.0.0.1:{port}", lab.tls, lab.port, heard.silent)
    lab.closed.append(lambda: dialled.close(WAIT))
    assert not dialled.wait(0.2)
    assert dialled.connected_for == 0.0
    session: Any = vehicle_session(port, lab.tls, "127.0.0.1")
    assert dialled.wait(WAIT)
    session.close()
    wait_for(lambda: not dialled.connected)
    assert dialled.reopened == 0  # there is no link that could be deaf


def test_mistakes_are_told_at_once(lab: Lab, tmp_path: Path) -> None:
    with pytest.raises(LinkError, match=r"not for 10\.9\.8\.7"):
        Radio("10.9.8.7", lab.tls, lab.port, lambda: 0.0)
    with pytest.raises(LinkError, match=r"ca\.pem is missing; copy it back"):
        Radio("10.9.8.7", TlsFiles(tmp_path), lab.port, lambda: 0.0)
    with pytest.raises(UsageError, match="not the address of a vehicle"):
        Radio("10.9.8.7:x", lab.tls, lab.port, lambda: 0.0)
    with pytest.raises(LinkError, match=rf"^TCP port {lab.port} .*in use; stop .*$"):
        hub_session(lab.port)
