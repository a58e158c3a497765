"""The networks of this machine that are small enough to scan."""

from __future__ import annotations

import ipaddress
from pathlib import Path

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
