"""Addresses of this computer, and of vehicles."""

from __future__ import annotations

from quadrotor.errors import UsageError

LOOPBACK = "127.0.0.1"
EVERYWHERE = "0.0.0.0"
"""Address to listen on that stands for every one of this computer."""
VEHICLE_PORT = 7447


def parse_endpoint(text: str) -> tuple[str, int]:
    """Return (host, port) of `host`, `host:port`, `[v6]:port` or `quic/…`. Raises UsageError."""
    place = text.removeprefix("quic/").split("?")[0]
    host, colon, port = place.rpartition(":")
    if not colon or place.endswith("]"):
        host, port = place, str(VEHICLE_PORT)
    if not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise UsageError(
            f"{text!r} is not the address of a vehicle; write its name or address, "
            f"with :port unless it is {VEHICLE_PORT}"
        )
    return host.strip("[]"), int(port)
