"""The vehicle's clock as seen from the station: offset and round trip from TimeSync exchanges.

For one exchange, with client times t0, t3 and server times t1, t2 (NTP): round trip
(t3 - t0) - (t2 - t1), offset ((t1 - t0) + (t2 - t3)) / 2, wrong by at most half the round trip.
So, of the last few exchanges, the one with the smallest round trip gives the best offset.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from quadrotor.errors import LinkError
from vehicle_link.clock import time_ns
from vehicle_link.messages import Message, new
from vehicle_link.messages.records import TimeSyncRequest

if TYPE_CHECKING:
    from vehicle_link.transport.client import ServiceClient
    from vehicle_link.transport.node import Node

TIME_SYNC = "quadlab_msgs/srv/TimeSync"
WINDOW = 10
"""Number of exchanges considered: at 1 Hz clocks drift by less than 1 ms in that time."""


@dataclass(frozen=True, slots=True)
class Exchange:
    """Four stamps in ns; those of the server are on its clock."""

    client_sent_ns: int
    server_received_ns: int
    server_sent_ns: int
    client_received_ns: int

    @property
    def round_trip_ns(self) -> int:
        total = self.client_received_ns - self.client_sent_ns
        return total - (self.server_sent_ns - self.server_received_ns)

    @property
    def offset_ns(self) -> int:
        """Return the server's clock minus the client's."""
        there = self.server_received_ns - self.client_sent_ns
        back = self.server_sent_ns - self.client_received_ns
        return (there + back) // 2


class ClockOffset:
    """The offset of the server's clock over a sliding window of exchanges.

    One thread adds, any thread reads: the window is a tuple that is replaced, never changed.
    """

    def __init__(self, window: int = WINDOW) -> None:
        self._window = window
        self._exchanges: tuple[Exchange, ...] = ()
        self.offset_ns = 0
        """The server's clock minus the client's; 0 before the first exchange."""

    @property
    def known(self) -> bool:
        return bool(self._exchanges)

    @property
    def round_trip_ns(self) -> int:
        """Return the round trip of the newest exchange in ns; 0 before the first."""
        exchanges = self._exchanges
        return exchanges[-1].round_trip_ns if exchanges else 0

    def add(self, exchange: Exchange) -> None:
        """Add an exchange; empty the window if the server's clock was set, as by a restart."""
        kept = self._exchanges if self._exchanges and self._agrees(exchange) else ()
        self._exchanges = (*kept, exchange)[-self._window :]
        self.offset_ns = min(self._exchanges, key=lambda e: e.round_trip_ns).offset_ns

    def to_server(self, client_ns: int) -> int:
        """Convert a time of the client's clock to the server's."""
        return client_ns + self.offset_ns

    def to_client(self, server_ns: int) -> int:
        return server_ns - self.offset_ns

    def clear(self) -> None:
        self._exchanges, self.offset_ns = (), 0

    def _agrees(self, exchange: Exchange) -> bool:
        """Return whether an exchange agrees with the best one: both offsets are accurate to half
        their round trip, plus a little drift.
        """
        best = min(self._exchanges, key=lambda e: e.round_trip_ns)
        allowed = (best.round_trip_ns + exchange.round_trip_ns) // 2 + 10_000_000
        return abs(exchange.offset_ns - best.offset_ns) <= allowed


def serve_time_sync(node: Node, clock: Callable[[], int] = time_ns) -> None:
    """Serve `time_sync` on the network thread; `clock` returns this end's time in ns."""

    def answer(_request: TimeSyncRequest) -> Message:
        received = clock()
        return new(f"{TIME_SYNC}_Response", server_received_ns=received, server_sent_ns=clock())

    node.serve("time_sync", TIME_SYNC, answer, direct=True)


def exchange(client: ServiceClient[Message], timeout: float = 1.0) -> Exchange:
    """Make one exchange with a server of TimeSync. Raises LinkError."""
    sent = time_ns()
    response = client.call(new("quadlab_msgs/srv/TimeSync_Request", client_sent_ns=sent), timeout)
    return Exchange(sent, int(response.server_received_ns), int(response.server_sent_ns), time_ns())


def answers(client: ServiceClient[Message], timeout: float) -> bool:
    """Return whether the server answers within `timeout` seconds."""
    try:
        exchange(client, timeout=timeout)
    except LinkError:
        return False
    return True
