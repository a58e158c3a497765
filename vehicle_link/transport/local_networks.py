"""The networks this machine stands in, small enough to look through."""

from __future__ import annotations

import ipaddress
from pathlib import Path

SMALLEST_PREFIX = 22
"""Shortest prefix that is searched: at most some 1000 addresses."""
ROUTES = Path("/proc/net/route")


def own_networks(routes: Path = ROUTES) -> list[ipaddress.IPv4Network]:
    """Return directly attached IPv4 networks (Linux); larger ones are left out."""
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
    """Return an address; the kernel prints them in the machine's own order of bytes (little
    endian).
    """
    return int.from_bytes(word.to_bytes(4, "little"), "big")


def _mask_length(mask: int) -> int:
    return mask.bit_count()
