"""Latency of a laboratory's page: of requests, and of pings on its websocket."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field

import httpx
import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from benchmarks.safety.laboratory import Laboratory

LOOK = 0.02  # s
LOST = 10.0
"""Time, in s, after which a ping counts as answered."""
QUIET = 150
"""Measurements without an attack."""


@dataclass
class Latency:
    """Times, in s, of a page's requests, and of pings on its websocket."""

    answers: list[float] = field(default_factory=list)
    pings: list[float] = field(default_factory=list)

    def measure(self, lab: Laboratory, socket: ClientConnection) -> None:
        """Add one of each."""
        asked = time.monotonic()
        lab.summary()
        self.answers.append(time.monotonic() - asked)
        asked = time.monotonic()
        self.pings.append(time.monotonic() - asked if socket.ping().wait(LOST) else LOST)
        time.sleep(LOOK)

    def figures(self) -> dict[str, float]:
        """Return median and 99th percentile of both, in ms."""
        return {
            f"{name} {share}, ms": 1e3 * float(np.quantile(of, q))
            for name, of in (("answer", self.answers), ("ping", self.pings))
            for share, q in (("median", 0.5), ("p99", 0.99))
        }


def quiet_latency(lab: Laboratory, socket: ClientConnection) -> Latency:
    """Return the page's latency without an attack."""
    latency = Latency()
    for _ in range(QUIET):
        latency.measure(lab, socket)
    return latency


@contextmanager
def page_socket(lab: Laboratory) -> Iterator[ClientConnection]:
    """Yield a websocket of the signed-in page; what arrives on it is dropped."""
    socket = connect(
        f"{lab.base.replace('http', 'ws')}/ws/events",
        additional_headers={"Cookie": cookie_of(lab.browser)},
        origin=Origin(lab.base),
    )

    def drain() -> None:
        with suppress(ConnectionClosed):
            for _ in socket:
                pass

    draining = threading.Thread(target=drain, daemon=True)
    with socket:
        draining.start()
        yield socket
    draining.join()


def cookie_of(client: httpx.Client) -> str:
    return "; ".join(f"{one.name}={one.value}" for one in client.cookies.jar)
