"""Trails in the 3D view: the flown or reference path of the last 20 s, cheap to send.

A trail sent completely at 30 Hz costs megabytes a second. So the newest 16 segments (the head)
are one node, sent again with every frame; full heads are copied into a chunk of 128 segments,
sent again twice a second; chunks form a ring whose nodes are reused, never removed (viser keeps a
tombstone of each removed node). Together this is 18 kB/s a trail and client while moving.

`TrailRing` does the bookkeeping; `Trail` draws it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from web.view.lines import line_color

HEAD = 16  # segments
CHUNK = 128  # segments
CHUNKS = 5
DURATION = 20.0  # s
SMALLEST_STEP = 0.004  # m; smaller movements add nothing
LARGEST_STEP = 1.5  # m between two samples; more is a jump, drawn as a gap
LONGEST_GAP = 0.5  # s without a sample; more is drawn as a gap

Segments = npt.NDArray[np.float32]


@dataclass
class Piece:
    """Content of one node: up to `size` segments, padded with the last point."""

    size: int
    segments: Segments = field(init=False)
    count: int = 0
    first: float = 0.0  # s, time of its first point

    def __post_init__(self) -> None:
        self.segments = np.zeros((self.size, 2, 3), np.float32)

    def append(self, start: Sequence[float], end: Sequence[float], now: float) -> None:
        if self.count == 0:
            self.first = now
        self.segments[self.count] = (start, end)
        self.segments[self.count + 1 :] = end
        self.count += 1

    def take(self, other: Piece) -> None:
        """Append the other piece's segments and empty it."""
        if self.count == 0:
            self.first = other.first
        stop = self.count + other.count
        self.segments[self.count : stop] = other.segments[: other.count]
        self.segments[stop:] = other.segments[other.count - 1, 1]
        self.count = stop
        other.count = 0


class TrailRing:
    """Ring of pieces that get points (m, world) and report which of them changed."""

    def __init__(self) -> None:
        self.head = Piece(HEAD)
        self.chunks = [Piece(CHUNK) for _ in range(CHUNKS)]
        self._active = 0
        self._last: tuple[float, ...] | None = None
        self._last_time = 0.0

    def add(self, point: Sequence[float], now: float) -> set[int]:
        """Add a point; return the pieces that changed: chunk indices, and -1 for the head."""
        changed = self._expire(now)
        last, position = self._last, tuple(float(x) for x in point)
        if last is None:
            self._last, self._last_time = position, now
            return changed
        step = float(
            np.hypot(np.hypot(position[0] - last[0], position[1] - last[1]), position[2] - last[2])
        )
        is_gap = step > LARGEST_STEP or now - self._last_time > LONGEST_GAP
        self._last_time = now
        if step < SMALLEST_STEP and not is_gap:
            return changed
        if self.head.count == HEAD:
            changed.add(self._store_head())
        self.head.append(position if is_gap else last, position, now)
        self._last = position
        return changed | {-1}

    def clear(self) -> set[int]:
        """Remove all points, and return the pieces that had content."""
        changed = {i for i, piece in enumerate(self.chunks) if piece.count}
        if self.head.count:
            changed.add(-1)
        for piece in (self.head, *self.chunks):
            piece.count = 0
        self._last = None
        return changed

    def _store_head(self) -> int:
        if self.chunks[self._active].count + HEAD > CHUNK:
            self._active = (self._active + 1) % CHUNKS
            self.chunks[self._active].count = 0
        self.chunks[self._active].take(self.head)
        return self._active

    def _expire(self, now: float) -> set[int]:
        changed = set()
        for i, piece in enumerate(self.chunks):
            if piece.count and now - piece.first > DURATION:
                piece.count = 0
                changed.add(i)
        return changed


class Trail:
    """Trail drawn with reused line nodes; `color` is sRGB, 0 to 255."""

    def __init__(
        self, scene: Any, name: str, color: tuple[int, int, int], thickness: float
    ) -> None:
        self._ring = TrailRing()
        self._nodes: dict[int, Any] = {}
        for index, piece in {-1: self._ring.head, **dict(enumerate(self._ring.chunks))}.items():
            self._nodes[index] = scene.add_line_segments(
                f"{name}/{'head' if index < 0 else index}",
                piece.segments,
                line_color(color),
                thickness=thickness,
                thickness_units="screen",
                visible=False,
            )

    def add(self, point: Sequence[float], now: float) -> None:
        self._draw(self._ring.add(point, now))

    def clear(self) -> None:
        self._draw(self._ring.clear())

    def _draw(self, changed: set[int]) -> None:
        for index in changed:
            piece = self._ring.head if index < 0 else self._ring.chunks[index]
            node = self._nodes[index]
            if piece.count:
                node.points = piece.segments
            node.visible = piece.count > 0
