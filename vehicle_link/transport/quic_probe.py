"""A probe whether a vehicle's end of the link answers, without presenting or seeing a certificate,
and the networks of this machine that are small enough to scan.

A QUIC server answers a packet of an unknown version with the versions that it supports (RFC 9000,
section 6). So for a link that does not open one can tell whether no machine answers or whether one
does not accept us.
"""

from __future__ import annotations

import ipaddress
import secrets
import socket
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from enum import StrEnum
from pathlib import Path

from vehicle_link.transport.session import OPEN_S

RESERVED_VERSION = 0x1A2A3A4A  # RFC 9000, section 15: exists to force a negotiation
LEAST = 1200  # bytes of a first packet
TRIES = 3
AT_ONCE = 64


class ProbeResult(StrEnum):
    ANSWERS = "answers"
    CLOSED = "closed"  # the machine is up, but nothing listens
    SILENT = "silent"
    NAMELESS = "nameless"  # the host name cannot be resolved


EXPLANATIONS = {
    ProbeResult.ANSWERS: "a vehicle answers there, but the link does not open: one end does not "
    "accept the other's certificate (it is of another base, out of date by that end's clock, or "
    "not for this address: enrol the vehicle again with `quadlab link enrol`, and check both "
    f"clocks), or is too busy to open the link within {OPEN_S:g} s",
    ProbeResult.CLOSED: "the machine is there, but no `quadlab vehicle` listens on this port",
    ProbeResult.SILENT: "nothing answers; is the vehicle on, in this network, and UDP let through?",
    ProbeResult.NAMELESS: "this name cannot be resolved; give the vehicle's address instead",
}
"""Reasons, for users, why there is no link."""


def probe(host: str, port: int, timeout: float = 0.3) -> ProbeResult:
    """Probe one host; wait at most three times `timeout` seconds, and for the resolver."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[
            0
        ]
    except (OSError, UnicodeError):
        return ProbeResult.NAMELESS
    own = secrets.token_bytes(8)
    with socket.socket(family, kind, protocol) as sender:
        sender.settimeout(timeout)
        try:
            sender.connect(address)
            for _ in range(TRIES):
                sender.send(_initial(own))
                try:
                    if _negotiates(sender.recv(2048), own):
                        return ProbeResult.ANSWERS
                except TimeoutError:
                    continue
        except ConnectionRefusedError:
            return ProbeResult.CLOSED
        except OSError:  # no route
            return ProbeResult.SILENT
    return ProbeResult.SILENT


def probe_all(places: Sequence[tuple[str, int]]) -> dict[tuple[str, int], ProbeResult]:
    """Probe many (host, port) at once, as `probe` does; the answers are in their order."""
    if not places:
        return {}
    with ThreadPoolExecutor(min(AT_ONCE, len(places))) as pool:
        results = pool.map(lambda place: probe(*place), places)
        return dict(zip(places, results, strict=True))


def _initial(own: bytes) -> bytes:
    """Return a long header of the reserved version; answers are addressed to `own` (8 bytes)."""
    head = bytes([0xC0]) + RESERVED_VERSION.to_bytes(4, "big")
    head += bytes([8]) + secrets.token_bytes(8) + bytes([len(own)]) + own
    return head.ljust(LEAST, b"\0")


def _negotiates(answer: bytes, own: bytes) -> bool:
    """Return whether this is a Version Negotiation: long header, version 0, our own connection id
    as its destination.
    """
    return (
        len(answer) > 6 + len(own)
        and answer[0] & 0x80 != 0
        and answer[1:5] == bytes(4)
        and answer[6 : 6 + answer[5]] == own
    )


SMALLEST_PREFIX = 22
"""Shortest prefix that is scanned: at most about 1000 addresses."""
ROUTES = Path("/proc/net/route")


def own_networks(routes: Path = ROUTES) -> list[ipaddress.IPv4Network]:
    """Return the directly attached IPv4 networks (Linux) that are small enough."""
    try:
        rows = [line.split() for line in routes.read_text().splitlines()[1:]]
    except OSError:
        return []
    found = set()
    for row in rows:
        destination, gateway, mask = (int(row[k], 16) for k in (1, 2, 7))
        network = ipaddress.IPv4Network((_swapped(destination), _mask_length(mask)))
        if gateway == 0 and network.prefixlen >= SMALLEST_PREFIX:
            found.add(network)
    return sorted(found)


def _swapped(word: int) -> int:
    """Return an address that the kernel prints in the machine's own byte order (little endian)."""
    return int.from_bytes(word.to_bytes(4, "little"), "big")


def _mask_length(mask: int) -> int:
    return mask.bit_count()
