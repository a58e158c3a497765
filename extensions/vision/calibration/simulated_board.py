"""A simulated camera, before which a simulated hand moves a calibration board as the guide asks."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator

import numpy as np

from extensions.vision.simulated.rendered_camera import Pattern, RenderedCamera
from extensions.vision.tags.board_guide import BoardGuide
from extensions.vision.tags.charuco import Board
from extensions.vision.tags.detector import Picture
from quadrotor.records import Array
from quadrotor.rotations import rotation_exp

WIDTH, HEIGHT = 640, 480
MATRIX = np.array([[600.0, 0.0, 322.0], [0.0, 602.0, 238.0], [0.0, 0.0, 1.0]])
DISTORTION = np.array([-0.2, 0.05, 0.001, -0.001, 0.0])
NOISE = 2.0
"""Standard deviation of a pixel, grey levels."""
PERIOD_NS = 200_000_000
"""Simulated time between two pictures."""
MOVES, HELD = 1, 5
"""Pictures of a moving board, and then of one that is held; after these the hand tries again."""
TILT, UNSTEADY = math.radians(30.0), math.radians(6.0)
WIDTHS = {"near": 0.75, "far": 0.35}
USUAL_WIDTH = 0.5
"""Width of the board in widths of the picture."""
TILTS = {"left": (0, -1), "right": (0, 1), "upper": (1, 0), "lower": (-1, 0)}
FACING = np.diag([1.0, -1.0, -1.0])


class SimulatedPictures:
    """Iterates over (None, simulated time in ns, grey picture), like `camera.Pictures`.

    Args:
        board: the one that is shown.
        guide: whose goals the hand follows.
        pace: s to wait before each picture.
    """

    def __init__(self, board: Board, guide: BoardGuide, pace: float = 0.0) -> None:
        self._board, self._guide, self._pace = board, guide, pace
        self._random = np.random.default_rng(1)
        self._printed = board.picture()
        self._sharp, self._rough = (
            RenderedCamera(WIDTH, HEIGHT, MATRIX, DISTORTION, noise=0.0, fine=fine)
            for fine in (2, 1)
        )
        self._closed = threading.Event()
        self._now_ns = 0

    def __iter__(self) -> Iterator[tuple[None, int, Picture]]:
        place, turn = self._wanted("")
        while not self._closed.is_set():
            goal = self._guide.goal
            key = "" if goal is None else goal.key
            start = place, turn
            place, turn = self._wanted(key)
            for k in range(1, MOVES + 1):
                share = k / (MOVES + 1)
                moving = (
                    start[0] + share * (place - start[0]),
                    start[1] + share * (turn - start[1]),
                )
                yield self._picture(self._rendered(self._rough, *moving))
            held = self._rendered(self._sharp, place, turn)
            for _ in range(HELD):
                yield self._picture(held)
                now = self._guide.goal
                if now is None or now.key != key:
                    break

    def close(self) -> None:
        self._closed.set()

    def _wanted(self, key: str) -> tuple[Array, Array]:
        """Return where the hand holds the board for a goal: position (3,) m of its middle, and the
        rotation vector (3,) of its axes (x right, y down), in camera axes.
        """
        turn = self._random.uniform(-UNSTEADY, UNSTEADY, 3)
        width, at = WIDTHS.get(key, USUAL_WIDTH), np.array([0.5, 0.5])
        if key in TILTS:
            turn[:2] = TILT * np.array(TILTS[key])
        elif key.startswith("place-"):
            at = (np.array(key.split("-")[1:], float) + 0.5) / 3.0
        elif key == "more":
            at, turn[:2] = self._random.uniform(0.3, 0.7, 2), self._random.uniform(-TILT, TILT, 2)
        depth = max(self._board.size) * MATRIX[0, 0] / (width * WIDTH)
        ray = np.linalg.solve(MATRIX, [at[0] * WIDTH, at[1] * HEIGHT, 1.0])
        return depth * ray, turn

    def _rendered(self, camera: RenderedCamera, place: Array, turn: Array) -> Picture:
        board = Pattern(self._printed, self._board.size, place, rotation_exp(turn) @ FACING)
        return camera.take([board], self._random)

    def _picture(self, grey: Picture) -> tuple[None, int, Picture]:
        self._closed.wait(self._pace)
        self._now_ns += PERIOD_NS
        noisy = grey + NOISE * self._random.standard_normal(grey.shape, dtype=np.float32)
        return None, self._now_ns, np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
