"""The watch of a web process over what it hears, with a port that accepts or not."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest

from vehicle_link.messages import decode
from web.latest import Live
from web.live.deafness import CHECKS, DEAF_AFTER, Deafness


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def station() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        yield listening


def watched(port: int) -> tuple[Clock, Live, Deafness]:
    clock = Clock()
    live = Live(decode, clock)
    return clock, live, Deafness([live, Live(decode, clock)], port, lambda: None)


def test_one_that_is_not_heard_though_it_is_there_is_noticed(station: socket.socket) -> None:
    clock, live, deafness = watched(station.getsockname()[1])
    live.put("link_status", b"")
    clock.now = DEAF_AFTER
    assert not deafness.is_deaf()
    clock.now += 0.1
    assert [deafness.is_deaf() for _ in range(CHECKS)] == [False] * (CHECKS - 1) + [True]


def test_a_message_begins_anew(station: socket.socket) -> None:
    clock, live, deafness = watched(station.getsockname()[1])
    live.put("link_status", b"")
    clock.now = DEAF_AFTER + 0.1
    assert not any(deafness.is_deaf() for _ in range(CHECKS - 1))
    live.put("link_status", b"")
    assert not deafness.is_deaf()
    clock.now *= 2.0
    assert not any(deafness.is_deaf() for _ in range(CHECKS - 1))


def test_before_the_first_message_nothing_counts(station: socket.socket) -> None:
    clock, _, deafness = watched(station.getsockname()[1])
    clock.now = 1e3
    assert not any(deafness.is_deaf() for _ in range(2 * CHECKS))


def test_a_station_that_is_away_is_waited_for() -> None:
    with socket.create_server(("127.0.0.1", 0)) as gone:
        port = gone.getsockname()[1]
    clock, live, deafness = watched(port)
    live.put("link_status", b"")
    clock.now = 1e3
    assert not any(deafness.is_deaf() for _ in range(2 * CHECKS))
