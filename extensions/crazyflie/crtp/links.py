"""The links to a Crazyflie, as ports: `udp://HOST:PORT`, `radio://NUMBER/CHANNEL/RATE/ADDRESS`."""

from __future__ import annotations

import re

from extensions.crazyflie.crtp.udp import UdpPort
from quadrotor.errors import LinkError

UDP_PORT = 19850
"""First UDP port of simulated Crazyflies, by the firmware's own convention."""
_UDP = re.compile(r"udp://([^:/]+):(\d{1,5})$")
EXAMPLES = f"udp://127.0.0.1:{UDP_PORT} or radio://0/80/2M/E7E7E7E7E7"


def open_udp(word: str) -> UdpPort:
    """Return the opened link `udp://HOST:PORT`. Raises LinkError."""
    found = _UDP.match(word)
    if not found or not 1 <= int(found[2]) <= 65535:
        raise LinkError(f"link {word} cannot be opened: give one like {EXAMPLES}")
    try:
        return UdpPort(found[1], int(found[2]))
    except OSError as error:
        raise LinkError(
            f"link {word} cannot be opened: {error.strerror}; is the host right?"
        ) from None
