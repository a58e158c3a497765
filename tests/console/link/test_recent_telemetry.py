"""The station serves the telemetry of the last seconds, and stores none without requests."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from typing import Any

import pytest

from console.link.recent_telemetry import ASKED_WITHIN, SECONDS, RecentTelemetry
from tests.waiting import free_port
from vehicle_link.messages import new
from vehicle_link.topics import SERVICES
from vehicle_link.transport.node import Node
from vehicle_link.transport.session import hub_session, loopback_session

SERVICE = SERVICES["recent_telemetry"]


class Kept:
    """A page's call of the service over real sessions, with a clock set by hand."""

    def __init__(self) -> None:
        port = free_port(socket.SOCK_STREAM)
        self.now = 100.0
        self._hub, self._page = hub_session(port), loopback_session(port)
        self.kept = RecentTelemetry(Node(self._hub, "/quad1", "station"), lambda: self.now)
        node = Node(self._page, "/quad1", "web")
        self._client = node.client("station/recent_telemetry", SERVICE)

    def receive(self, seconds: float, payload: bytes) -> None:
        self.now += seconds
        self.kept.received(payload)

    def ask(self) -> list[bytes]:
        answer: Any = self._client.call(new(f"{SERVICE}_Request"), timeout=10.0)
        assert answer.accepted
        packets, found, at = answer.packets.tobytes(), [], 0
        for length in answer.lengths.tolist():
            found.append(packets[at : at + length])
            at += length
        return found

    def close(self) -> None:
        self._page.close()
        self._hub.close()


@pytest.fixture
def kept() -> Iterator[Kept]:
    one = Kept()
    yield one
    one.close()


def test_packets_are_kept_from_the_first_request_on_for_the_last_seconds(kept: Kept) -> None:
    kept.receive(1.0, b"before")
    assert kept.ask() == []
    kept.receive(0.5, b"one")
    kept.receive(0.5, b"and another")
    assert kept.ask() == [b"one", b"and another"]
    kept.receive(SECONDS - 0.4, b"newest")
    assert kept.ask() == [b"and another", b"newest"]


def test_what_nobody_has_asked_for_lately_is_dropped(kept: Kept) -> None:
    kept.ask()
    kept.receive(1.0, b"kept")
    kept.receive(ASKED_WITHIN, b"nobody asked")
    assert kept.ask() == []
    kept.receive(0.1, b"again")
    assert kept.ask() == [b"again"]
