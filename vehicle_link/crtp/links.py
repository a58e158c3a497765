"""The links to a Crazyflie, as ports: `udp://HOST:PORT`, `radio://NUMBER/CHANNEL/RATE/ADDRESS`."""

from __future__ import annotations

import re

from quadrotor.errors import LinkError
from vehicle_link.crtp.udp import UdpPort
from vehicle_link.serial.port import Port, SerialPort

UDP_PORT = 19850
"""First UDP port of simulated Crazyflies, by the firmware's own convention."""
_UDP = re.compile(r"udp://([^:/]+):(\d{1,5})$")
EXAMPLES = f"udp://127.0.0.1:{UDP_PORT} or radio://0/80/2M/E7E7E7E7E7"


def is_link(word: str) -> bool:
    """Return whether a port is named as a link and is no device."""
    return "://" in word


def open_port(word: str, baud_rate: int) -> Port:
    """Return the opened link or serial device. Raises LinkError, PortError for a device."""
    if not is_link(word):
        return SerialPort(word, baud_rate)
    if word.startswith("radio://"):
        from vehicle_link.crtp.radio import open_radio  # needs pyusb

        return open_radio(word)
    found = _UDP.match(word)
    if not found or not 1 <= int(found[2]) <= 65535:
        raise LinkError(f"link {word} cannot be opened: give one like {EXAMPLES}")
    try:
        return UdpPort(found[1], int(found[2]))
    except OSError as error:
        raise LinkError(
            f"link {word} cannot be opened: {error.strerror}; is the host right?"
        ) from None
