"""One direction of an impaired link: packets in, packets out, by a given clock.

There are no sockets here: the fate of a packet is decided when it arrives, so that the same seed
and the same packets give the same link.
"""

from __future__ import annotations

import heapq
import itertools
import math
import random
from dataclasses import dataclass, replace

QUEUE = 64_000


@dataclass(frozen=True)
class Conditions:
    """Conditions of a wire.

    Attributes:
        delay: s.
        jitter: s, half the width of an additional uniform part; packets keep their order.
        loss: share of packets, 0…1.
        burst: s, mean length of a time in which all are lost; 0 loses packets independently.
        rate: bit/s, 0 for unlimited.
        queue: bytes that wait for a slow wire; more are dropped.
    """

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    burst: float = 0.0
    rate: float = 0.0
    queue: int = QUEUE

    def __post_init__(self) -> None:
        if not 0.0 <= self.loss <= 1.0:
            raise ValueError(f"loss {self.loss} is no share; allowed 0 to 1")
        if self.jitter > self.delay:
            raise ValueError(f"jitter {self.jitter} s exceeds the delay of {self.delay} s")

    def changed(self, **values: float) -> Conditions:
        return replace(self, **values)  # type: ignore[arg-type]


class Wire:
    """One direction of a link.

    Attributes:
        sent, lost, overflowed: packets so far; overflowed ones found the queue full.
        bytes: of the packets that were carried.
    """

    def __init__(self, conditions: Conditions, seed: int) -> None:
        self.sent = self.lost = self.overflowed = self.bytes = 0
        self._conditions = conditions
        self._random = random.Random(seed)
        self._on_wire: list[tuple[float, int, bytes]] = []
        self._count = itertools.count()
        self._free_at = -math.inf  # when the last queued packet has left
        self._last_out = -math.inf
        self._interrupted_until = -math.inf
        self._bad = False
        self._state_ends = -math.inf

    def change(self, conditions: Conditions) -> None:
        """Change the conditions from now on; packets on their way are not affected."""
        self._conditions = conditions

    def interrupt(self, now: float, duration: float) -> None:
        """Lose everything for this time, s."""
        self._interrupted_until = now + duration

    def offer(self, packet: bytes, now: float) -> None:
        """Offer an incoming packet."""
        c = self._conditions
        self.sent += 1
        if now < self._interrupted_until or self._loses(now):
            self.lost += 1
            return
        leaves = now
        if c.rate > 0.0:
            waiting = max(0.0, self._free_at - now) * c.rate / 8.0
            if waiting + len(packet) > c.queue:
                self.overflowed += 1
                return
            leaves = max(now, self._free_at) + 8.0 * len(packet) / c.rate
            self._free_at = leaves
        self.bytes += len(packet)
        arrives = leaves + c.delay + self._random.uniform(-c.jitter, c.jitter)
        self._last_out = arrives = max(arrives, self._last_out)
        heapq.heappush(self._on_wire, (arrives, next(self._count), packet))

    def due(self, now: float) -> list[bytes]:
        """Return packets that have arrived."""
        arrived = []
        while self._on_wire and self._on_wire[0][0] <= now:
            arrived.append(heapq.heappop(self._on_wire)[2])
        return arrived

    @property
    def next_arrival(self) -> float:
        """Return when `due` has the next packet; infinite when none is on its way."""
        return self._on_wire[0][0] if self._on_wire else math.inf

    def _loses(self, now: float) -> bool:
        c = self._conditions
        if c.burst <= 0.0 or not 0.0 < c.loss < 1.0:
            return self._random.random() < c.loss
        # Good and bad times alternate, each of random length; the share of bad ones is `loss`.
        while now >= self._state_ends:
            begun = now if math.isinf(self._state_ends) else self._state_ends
            self._bad = not self._bad if not math.isinf(self._state_ends) else False
            mean = c.burst if self._bad else c.burst * (1.0 - c.loss) / c.loss
            self._state_ends = begun + self._random.expovariate(1.0 / mean)
        return self._bad
