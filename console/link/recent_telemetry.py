"""Telemetry of the last seconds at the flight loop's rate, for live spectra.

A page gets 25 samples a second, too few for the vibration of rotors. The packets are stored only
while a page requests them.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

import numpy as np

from vehicle_link.messages import new
from vehicle_link.messages.records import Message, RecentTelemetryRequest
from vehicle_link.topics import SERVICES
from vehicle_link.transport.node import Node

NAME = "recent_telemetry"
SECONDS = 5.0
"""Seconds of packets that are stored, by their reception."""
ASKED_WITHIN = 10.0
"""Seconds after the last request for which packets are still stored."""


class RecentTelemetry:
    """The packets of the last SECONDS, served as `/<vehicle>/station/recent_telemetry`.

    Args:
        clock: s, monotonic.
    """

    def __init__(self, node: Node, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._packets: deque[tuple[float, bytes]] = deque()
        self._asked = -ASKED_WITHIN
        node.serve(f"station/{NAME}", SERVICES[NAME], self._answer)

    def received(self, payload: bytes) -> None:
        """Store a packet of telemetry if there was a recent request; called by the receiving
        thread.
        """
        now = self._clock()
        if now - self._asked > ASKED_WITHIN:
            self._packets.clear()
            return
        self._packets.append((now, payload))
        while now - self._packets[0][0] > SECONDS:
            self._packets.popleft()

    def _answer(self, request: RecentTelemetryRequest) -> Message:
        self._asked = self._clock()
        # The copy is one step of the interpreter, so the receiving thread may continue.
        packets = [payload for _, payload in self._packets.copy()]
        return new(
            f"{SERVICES[NAME]}_Response",
            accepted=True,
            packets=np.frombuffer(b"".join(packets), np.uint8),
            lengths=[len(payload) for payload in packets],
        )
