"""The vehicle whose bearings contradict those of the others, found from what all of them broadcast.

Two vehicles that see each other measure opposite bearings. A vehicle whose bearings are opposite to
those of nearly no other has a turned sensor or confuses identities.
"""

from __future__ import annotations

import math

from extensions.formations.messages import Message
from quadrotor.plain_rotations import Triple

SHARE = 0.03
"""Weight of a new pair of bearings in the mean."""
LIMIT = 0.1
"""Length of the mean sum of two bearings that should be opposite, above which they are not."""
TOGETHER_NS = 300_000_000
"""Largest difference of the stamps of two bearings that are compared."""
PAIRS_MIN = 60
"""Pairs of bearings before a mean counts."""


class Suspicion:
    """The mean sum of the bearings of each pair, in world axes by the vehicles' own yaws."""

    def __init__(self) -> None:
        self._means: dict[tuple[int, int], Triple] = {}
        self._counts: dict[tuple[int, int], int] = {}

    def note(self, k: int, newest: dict[int, Message]) -> None:
        """Note the newest message of vehicle k."""
        mine = newest[k]
        for j, theirs in newest.items():
            if j == k or j not in mine.bearings_y or k not in theirs.bearings_y:
                continue
            if abs(mine.stamp_ns - theirs.stamp_ns) > TOGETHER_NS:  # one of them is silent
                continue
            pair = min(j, k), max(j, k)
            (x, y, z), (u, v, w) = _in_world(mine, j), _in_world(theirs, k)
            a, b, c = self._means.get(pair, (0.0, 0.0, 0.0))
            mean = a + SHARE * (x + u - a), b + SHARE * (y + v - b), c + SHARE * (z + w - c)
            self._means[pair] = mean
            self._counts[pair] = self._counts.get(pair, 0) + 1

    def worst(self) -> int | None:
        """Return the vehicle that contradicts at least two others and all but one, if one alone
        does.
        """
        pairs = [pair for pair, count in self._counts.items() if count >= PAIRS_MIN]
        wrong = [pair for pair in pairs if math.hypot(*self._means[pair]) > LIMIT]
        found = []
        for k in {one for pair in wrong for one in pair}:
            own, all_of_it = (sum(k in pair for pair in some) for some in (wrong, pairs))
            if own >= 2 and own >= all_of_it - 1:
                found.append((own, k))
        found.sort(reverse=True)
        if not found or (len(found) > 1 and found[0][0] == found[1][0]):
            return None
        return found[0][1]

    def forget(self, k: int) -> None:
        """Forget all pairs of a vehicle."""
        for pair in [pair for pair in self._means if k in pair]:
            del self._means[pair], self._counts[pair]


def _in_world(of: Message, k: int) -> Triple:
    x, y, z = of.bearings_y[k]
    c, s = math.cos(of.yaw), math.sin(of.yaw)
    return c * x - s * y, s * x + c * y, z
