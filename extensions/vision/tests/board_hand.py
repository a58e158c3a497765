"""A board in a person's hands before the camera of `extensions.vision.tests.tags.rendered`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from extensions.vision.simulated.rendered_camera import Pattern
from extensions.vision.tags.board_guide import BoardGuide
from extensions.vision.tags.charuco import Board, BoardView
from extensions.vision.tags.detector import Picture
from extensions.vision.tests.tags.rendered import CAMERA, FACING, MATRIX
from quadrotor.records import Array
from quadrotor.rotations import rotation_exp

BOARD = Board(7, 5, 0.05, 0.037)
MS = 1_000_000
TURN = 0.5  # rad
HELD = {
    "place-1-1": ((320, 240), 0.5, (0, 0)),
    "left": ((320, 240), 0.5, (0, -TURN)),
    "right": ((320, 240), 0.5, (0, TURN)),
    "upper": ((320, 240), 0.5, (TURN, 0)),
    "lower": ((320, 240), 0.5, (-TURN, 0)),
    "near": ((320, 240), 0.75, (0, 0)),
    "far": ((320, 240), 0.35, (0, 0)),
}
"""The place of the board for each goal: pixel, width in widths of the picture, tilts in rad."""


class Hand:
    """Holds a board as a guide says; the guide gets its corners without a picture."""

    def __init__(self, guide: BoardGuide, random: np.random.Generator) -> None:
        self._guide, self._random = guide, random
        self._now_ns = 0
        self.pose = np.zeros(3), np.eye(3)  # of the board in camera axes, when last held
        self._view: BoardView | None = None
        self._grid = np.array(
            [(c, r, 0.0) for r in range(1, BOARD.rows) for c in range(1, BOARD.columns)]
        )
        guide._reader = self  # type: ignore[assignment]

    def read(self, grey: Picture) -> tuple[BoardView | None, str]:
        return self._view, "" if self._view else "No board is seen"

    def hold(self, key: str, *, shown: int = 4, shake: float = 0.0) -> bool:
        """Show so many pictures of a board held for a goal; return whether one was taken."""
        pixel: Sequence[float]
        tilts: Sequence[float]
        if key in HELD:
            pixel, width, tilts = HELD[key]
        elif key == "more":
            pixel, width = self._random.uniform((220, 180), (420, 300)).tolist(), 0.5
            tilts = tuple(self._random.uniform(-TURN, TURN, 2))
        else:
            column, row = map(int, key.split("-")[1:])
            pixel, width, tilts = (107 + 213 * column, 80 + 160 * row), 0.5, (0.1, 0.1)
        depth = BOARD.size[0] * 600.0 / (width * 640.0)
        place = depth * np.linalg.solve(MATRIX, [*pixel, 1.0])
        R_cb = rotation_exp(np.array([*tilts, 0.02]))
        points = self._grid * BOARD.square
        middle = 0.5 * np.array([*BOARD.size, 0.0])
        self.pose = place, R_cb
        exact = CAMERA.project((points - middle) @ R_cb.T + place)
        before = len(self._guide.views)
        for k in range(shown):
            self.show(exact + k * shake, points)
        return len(self._guide.views) > before

    def show(self, exact: Array, points: Array) -> None:
        seen = exact + 0.05 * self._random.standard_normal(exact.shape)
        inside = ((seen > 0) & (seen < (640, 480))).all(axis=1)
        self._view = BoardView(np.flatnonzero(inside), points[inside], seen[inside])
        self._now_ns += 200 * MS
        self._guide.look(np.zeros((480, 640), np.uint8), self._now_ns)

    def picture(self) -> Picture:
        """Return a photograph of the board as it was last held."""
        place, R_cb = self.pose
        board = Pattern(BOARD.picture(), BOARD.size, place, R_cb @ FACING)
        return CAMERA.take([board], self._random)


def walk(views: int | None = None) -> BoardGuide:
    """Return a guide whose goals a person followed to the end, or until so many views."""
    guide = BoardGuide(BOARD)
    hand = Hand(guide, np.random.default_rng(3))
    for _ in range(60):
        if guide.goal is None or len(guide.views) == views:
            return guide
        hand.hold(guide.goal.key)
    raise AssertionError(f"never satisfied: {guide.state()}")
