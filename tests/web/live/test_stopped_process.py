"""A web process that stood still has every tick afterwards: what it missed comes later."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.live_signals import packets_of, ticks_of
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.session import hub_session
from web.live.sockets import listen

ROOT = Path(__file__).parents[3]
PACKETS = 8000
"""Number of packets of one halt: 8 MB, more than the system's and Zenoh's queues hold."""
LISTENER = """
import sys
from vehicle_link.messages import decode
from vehicle_link.transport.loopback import loopback_session
from web.latest import Live
from web.live.events import EventHub
from web.live.signal_log import SignalLog
from web.live.station import Reactions, Station

log = SignalLog()
live = Live(decode, also=log.put)
session = lambda: loopback_session(int(sys.argv[1]))
station = Station(session, "quad1", live, EventHub(), Reactions())
station.start()
station.watch(["state"])
for _ in sys.stdin:
    log.take()
    ticks = log.log("state")
    count = len(ticks.time) if ticks else 0
    print(count, sum(ticks.missing(0, count).values()) if count else 0, flush=True)
station.stop()
"""


class Listener:
    """Process with the subscriptions and the log of a web process."""

    def __init__(self, port: int) -> None:
        command = [sys.executable, "-c", LISTENER, str(port)]
        self._process = subprocess.Popen(
            command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def counted(self) -> tuple[int, int]:
        """Return how many ticks it has, and how many are missing among them."""
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin
        assert stdout
        stdin.write("\n")
        stdin.flush()
        count, missing = stdout.readline().split()
        return int(count), int(missing)

    def stop(self) -> None:
        os.kill(self._process.pid, signal.SIGSTOP)
        os.waitid(os.P_PID, self._process.pid, os.WSTOPPED)

    def go_on(self) -> None:
        os.kill(self._process.pid, signal.SIGCONT)

    def close(self) -> None:
        self.go_on()
        self._process.kill()
        self._process.communicate()


@pytest.fixture
def port() -> int:
    with listen("127.0.0.1", 0) as free:
        return int(free.getsockname()[1])


@pytest.fixture
def station(port: int) -> Iterator[Node]:
    session = hub_session(port)
    yield Node(session, "/quad1", "station")
    session.close()


@pytest.fixture
def listener(station: Node, port: int) -> Iterator[Listener]:
    made = Listener(port)
    yield made
    made.close()


def test_a_process_that_was_stopped_gets_the_ticks_that_it_missed(
    station: Node, listener: Listener
) -> None:
    ticks = station.advertise(TOPICS["ticks"])
    packets = iter(packets_of(ticks_of(5 * (PACKETS + 4000))))

    def put() -> int:
        ticks.put(next(packets), 1)
        return listener.counted()[0]

    before = next(count for _ in range(2000) if (count := put()))
    listener.stop()
    for _ in range(PACKETS):
        ticks.put(next(packets), 1)
    listener.go_on()
    assert any(put() > before + 5 * PACKETS for _ in range(2000))
    assert listener.counted()[1] == 0
