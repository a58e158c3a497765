"""The radio of a simulated Crazyflie: each packet is delayed, some are lost."""

from __future__ import annotations

import random
from collections import deque


class Radio:
    """One direction of the link; the same seed loses the same packets.

    Attributes:
        delay_ms: delay of a packet.
        loss: 0..1, share of lost packets.
    """

    def __init__(self) -> None:
        self.delay_ms, self.loss = 0, 0.0
        self._chance = random.Random(0)
        self._waiting: deque[tuple[int, bytes]] = deque()

    def seed(self, seed: int) -> None:
        self._chance = random.Random(seed)

    def put(self, packet: bytes, now_ms: int) -> None:
        """Send a packet."""
        if not self.loss or self._chance.random() >= self.loss:
            self._waiting.append((now_ms + self.delay_ms, packet))

    def take(self, now_ms: int) -> list[bytes]:
        """Return the packets that have arrived."""
        arrived = []
        while self._waiting and self._waiting[0][0] <= now_ms:
            arrived.append(self._waiting.popleft()[1])
        return arrived
