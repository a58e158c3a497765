"""One process that has a radio, and serves each Crazyflie on it by UDP to a process of its own."""

from __future__ import annotations

import select
import time
from collections.abc import Callable, Sequence
from typing import Protocol

from extensions.crazyflie.crtp.packets import FrameReader, Packet, decode, frame
from extensions.crazyflie.crtp.udp import UdpServer
from vehicle_link.serial.links import open_port
from vehicle_link.serial.port import Port

LOOK_MS = 100


class Watch(Protocol):
    """Whoever sees the packets of one Crazyflie; times are in s."""

    def passes(self, packet: Packet, now_s: float) -> bool:
        """Return whether a packet of the client may go up."""
        ...

    def hear(self, packet: Packet) -> None:
        """Note a packet of the Crazyflie."""
        ...

    def due(self, now_s: float) -> Sequence[Packet]:
        """Return packets of its own."""
        ...


def share(
    links: Sequence[tuple[str, int]], watches: Sequence[Watch], is_over: Callable[[], bool]
) -> None:
    """Pass packets on until `is_over`.

    Args:
        links: of each Crazyflie, and the UDP port where it is served on loopback.
        watches: one of each.

    Raises LinkError.
    """
    servers = [UdpServer(port) for _, port in links]
    ports = []
    try:
        ports += [open_port(word, 0) for word, _ in links]
        poll = select.poll()
        lines = [_Line(*ends) for ends in zip(ports, servers, watches, strict=True)]
        for end in (*ports, *servers):
            poll.register(end.fileno(), select.POLLIN)
        while not is_over():
            poll.poll(LOOK_MS)
            for line in lines:
                line.step(time.monotonic())
    finally:
        for end in (*ports, *servers):
            end.close()


class _Line:
    """The packets of one Crazyflie and its client."""

    def __init__(self, port: Port, server: Port, watch: Watch) -> None:
        self._port, self._server, self._watch = port, server, watch
        self._up, self._down = FrameReader(), FrameReader()

    def step(self, now_s: float) -> None:
        """Pass on what came."""
        watch = self._watch
        for data in self._down.feed(self._port.read()):
            watch.hear(decode(data))
            self._server.write(frame(data))
        for data in self._up.feed(self._server.read()):
            if watch.passes(decode(data), now_s):
                self._port.write(frame(data))
        for packet in watch.due(now_s):
            self._port.write(frame(packet.encode()))
