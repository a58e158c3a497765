"""`quadlab crazyradio`: has a Crazyradio, for one vehicle or several."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from quadrotor.errors import UsageError


@dataclass
class Crazyradio:
    """Serve each Crazyflie on one Crazyradio by UDP to a `quadlab vehicle` of its own, and land it
    when that falls silent in flight."""

    links: Annotated[
        tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="LINK=PORT [LINK=PORT ...]")
    ]
    """link of a Crazyflie and the UDP port for it, like radio://0/80/2M/E7E7E7E701=19850"""

    def run(self) -> int:
        from extensions.crazyflie.board.guard import Guard
        from extensions.crazyflie.crtp.share import share
        from vehicle_link.termination_signal import EndSignal

        links = [_split(word) for word in self.links]
        words = [word for link, port in links for word in (f"link {link}", f"port {port}")]
        for word in words:
            if words.count(word) > 1:
                raise UsageError(f"{word} is given twice; give each Crazyflie its own")
        for word, port in links:
            print(f"{word}: fly it with --serial udp://127.0.0.1:{port}", flush=True)
        stop = EndSignal()
        share(links, [Guard(word, print) for word, _ in links], lambda: stop.count > 0)
        return 0


def _split(word: str) -> tuple[str, int]:
    link, _, port = word.rpartition("=")
    if not link or not port.isdigit() or not 1 <= int(port) <= 65535:
        raise UsageError(
            f"{word!r} is not LINK=PORT; give one like radio://0/80/2M/E7E7E7E701=19850"
        )
    return link, int(port)
