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
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from web.view.lines import line_color

if TYPE_CHECKING:
    from viser import LineSegmentsHandle, SceneApi

HEAD = 16  # segments
CHUNK = 128  # segments
CHUNKS = 5
DURATION = 20.0  # s
SMALLEST_STEP = 0.004  # m; smaller movements add nothing
LARGEST_STEP = 1.5  # m between two samples; more is a jump, drawn as a gap
LONGEST_GAP = 0.5  # s without a sample; more is drawn as a gap

Segments = npt.NDArray[np.float32]
Color = tuple[int, int, int]
PLAIN: Color = (255, 255, 255)


@dataclass
class Piece:
    """Content of one node: up to `size` segments, padded with the last point."""

    size: int
    segments: Segments = field(init=False)
    colors: npt.NDArray[np.uint8] = field(init=False)
    count: int = 0
    first: float = 0.0  # s, time of its first point

    def __post_init__(self) -> None:
        self.segments = np.zeros((self.size, 2, 3), np.float32)
        self.colors = np.zeros((self.size, 2, 3), np.uint8)

    def append(
        self, start: Sequence[float], end: Sequence[float], now: float, color: Color = PLAIN
    ) -> None:
        if self.count == 0:
            self.first = now
        self.segments[self.count] = (start, end)
        self.segments[self.count + 1 :] = end
        self.colors[self.count :] = color
        self.count += 1

    def take(self, other: Piece) -> None:
        """Append the other piece's segments and empty it."""
        if self.count == 0:
            self.first = other.first
        stop = self.count + other.count
        self.segments[self.count : stop] = other.segments[: other.count]
        self.colors[self.count : stop] = other.colors[: other.count]
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

    def add(self, point: Sequence[float], now: float, color: Color = PLAIN) -> set[int]:
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
        self.head.append(position if is_gap else last, position, now, color)
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
    """Trail drawn with reused line nodes; `color` is sRGB, 0 to 255, of all that has no own."""

    def __init__(
        self, scene: SceneApi, name: str, color: tuple[int, int, int], thickness: float
    ) -> None:
        self._ring = TrailRing()
        self._nodes: dict[int, LineSegmentsHandle] = {}
        self._color = color
        self._many = False  # colours, of which each segment then has its own
        self._shown = True
        for index, piece in {-1: self._ring.head, **dict(enumerate(self._ring.chunks))}.items():
            self._nodes[index] = scene.add_line_segments(
                f"{name}/{'head' if index < 0 else index}",
                piece.segments,
                line_color(color),
                thickness=thickness,
                thickness_units="screen",
                visible=False,
            )

    def add(self, point: Sequence[float], now: float, color: Color | None = None) -> None:
        color = color or self._color
        self._many |= color != self._color
        self._draw(self._ring.add(point, now, line_color(color)))

    def clear(self) -> None:
        changed = self._ring.clear()
        self._draw(changed)
        self._many = False
        for index in self._nodes:
            self._nodes[index].colors = np.array(line_color(self._color), np.uint8)

    def show(self, shown: bool) -> None:
        self._shown = shown
        self._draw(set(self._nodes))

    def _draw(self, changed: set[int]) -> None:
        for index in changed:
            piece = self._ring.head if index < 0 else self._ring.chunks[index]
            node = self._nodes[index]
            if piece.count:
                node.points = piece.segments
                if self._many:
                    node.colors = piece.colors
            node.visible = piece.count > 0 and self._shown
