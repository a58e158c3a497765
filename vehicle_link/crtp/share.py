"""One process that has a radio, and serves each Crazyflie on it by UDP to a process of its own."""

from __future__ import annotations

import select
from collections.abc import Callable, Sequence

from vehicle_link.crtp.links import open_port
from vehicle_link.crtp.udp import UdpServer

LOOK_MS = 100


def share(links: Sequence[tuple[str, int]], is_over: Callable[[], bool]) -> None:
    """Pass packets on until `is_over`.

    Args:
        links: of each Crazyflie, and the UDP port where it is served on loopback.

    Raises LinkError.
    """
    servers = [UdpServer(port) for _, port in links]
    ports = []
    try:
        ports += [open_port(word, 0) for word, _ in links]
        poll = select.poll()
        for end in (*ports, *servers):
            poll.register(end.fileno(), select.POLLIN)
        while not is_over():
            poll.poll(LOOK_MS)
            for port, server in zip(ports, servers, strict=True):
                if data := port.read():
                    server.write(data)
                if data := server.read():
                    port.write(data)
    finally:
        for end in (*ports, *servers):
            end.close()
