"""Steps and doublets on one axis: the reference of a tuning test.

The position (or the yaw) of the reference jumps from one tick to the next, with all derivatives
zero before and after: the response is that of the feedback alone, by which gains are judged. No
vehicle can follow it; a smooth path would be followed by the feed-forward and show little of the
gains.
"""

from __future__ import annotations

from itertools import pairwise

from quadrotor.records import Record

POSITION = ("x", "y", "z")
AXES = (*POSITION, "yaw")
LEVELS = {"step": (1.0, 0.0), "doublet": (1.0, -1.0, 0.0)}
"""Levels relative to the amplitude, by shape, each held for one duration."""
SHAPES = tuple(LEVELS)

LEAD = 0.5
"""Rest, in s, before the first edge."""

Point = tuple[float, float, float]


class Multistep:
    """A trajectory on one axis about a point at rest; ends where it begins.

    Args:
        point: x, y, z (m), yaw (rad) of the reference at rest.
        axis: one of `AXES`; x, y, z are the world's.
        amplitude: m or rad, of either sign.
        duration: s of each level.
        repeats: how often the shape is flown.
        lead: s of rest before the first edge.

    Attributes:
        edges: (s, offset from then on in m or rad) in order; the first one is the start (0, 0).
    """

    def __init__(
        self,
        point: tuple[float, float, float, float],
        *,
        axis: str,
        shape: str,
        amplitude: float,
        duration: float,
        repeats: int = 1,
        lead: float = LEAD,
    ) -> None:
        self._point = point
        self._axis = AXES.index(axis)
        levels = [level * amplitude for level in LEVELS[shape]] * repeats
        self.edges = ((0.0, 0.0), *((lead + i * duration, x) for i, x in enumerate(levels)))
        self.duration = lead + len(levels) * duration
        """The duration in s, with the rest at both ends."""
        self._index = 0

    @property
    def span(self) -> tuple[float, float]:
        """Return the least and largest offset (m or rad)."""
        offsets = [offset for _, offset in self.edges]
        return min(offsets), max(offsets)

    @property
    def swing(self) -> float:
        """Return the largest jump at an edge (m or rad)."""
        return max(abs(b - a) for (_, a), (_, b) in pairwise(self.edges))

    def ends(self) -> tuple[Point, Point]:
        """Return the two ends of the path, corners of a box with each axis in order (m, world)."""
        low, high = list(self._point[:3]), list(self._point[:3])
        if self._axis < 3:
            low[self._axis] += self.span[0]
            high[self._axis] += self.span[1]
        return (low[0], low[1], low[2]), (high[0], high[1], high[2])

    def sample(self, t: float, reference: Record) -> None:
        """Fill `reference` (shape (1,)) for t (s).

        An edge takes effect at the first t not before it. Times must not decrease.
        """
        edges = self.edges
        while self._index + 1 < len(edges) and t >= edges[self._index + 1][0]:
            self._index += 1
        offset = edges[self._index][1]
        values = [*self._point]
        values[self._axis] += offset
        floats = reference.view("f8")
        floats[:] = 0.0
        reference["position_w"][0] = values[:3]
        reference["yaw"][0] = values[3]
