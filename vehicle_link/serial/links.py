"""The ports that are named on the command line: serial devices, and links that extensions open."""

from __future__ import annotations

from quadrotor.errors import LinkError
from quadrotor.extension import Link
from quadrotor.extensions import registry
from vehicle_link.serial.port import Port
from vehicle_link.serial.serial_port import SerialPort

SEPARATOR = "://"


def is_link(word: str) -> bool:
    """Return whether a port is named as a link and is no device."""
    return SEPARATOR in word


def open_port(word: str, baud_rate: int) -> Port:
    """Return the opened link or serial device.

    Raises LinkError, and UsageError where a library is missing; PortError for a device.
    """
    if not is_link(word):
        return SerialPort(word, baud_rate)
    known = registry().offers(Link)
    kind = word.partition(SEPARATOR)[0]
    if kind not in known:
        examples = " or ".join(one.offer.example for one in known.values())
        raise LinkError(
            f"link {word} cannot be opened: "
            + (f"give one like {examples}" if known else "no extension has links")
        )
    port: Port = known[kind].load()(word)
    return port
