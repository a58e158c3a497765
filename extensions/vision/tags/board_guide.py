"""The guide of a camera's calibration: takes views of a moved board, and says what is missing.

A view is taken when the board is still and adds something: a place in the picture, a tilt, a
distance. Those are what Zhang's method (`extensions.vision.tags.camera_calibration`) needs to tell
focal length, principal point and distortion apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from extensions.vision.tags.camera_calibration import (
    FEWEST_VIEWS,
    GRID,
    CameraCalibration,
    Cell,
    calibrate_camera,
    cells_of,
)
from extensions.vision.tags.charuco import Board, BoardReader, BoardView
from extensions.vision.tags.detector import Picture
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

ENOUGH_VIEWS, MOST_VIEWS = 12, 60
STILL_NS = 400_000_000
"""Time in ns for which the board must be still."""
STILL_SHIFT = 0.004
"""Share of the picture's width by which its corners may move in that time."""
PAUSE_NS = 1_000_000_000
"""Time in ns between two pictures after which stillness is judged anew."""
TILT = math.radians(20.0)
"""Smallest tilt of the board, about an axis of the picture, that counts."""
NEAR, FAR = 0.6, 0.4
"""Width of the board in widths of the picture: at least, to be near; at most, to be far."""
NEW_CELLS = 2
NEW_PLACE, NEW_TILT, NEW_SIZE = 0.15, math.radians(10.0), 1.2
"""Differences from all other views of one that only adds to their number: of its place, in widths
of the picture; of its tilt; of its size, as a factor."""
FIRST_GUESS = 0.9
"""Focal length in widths of the picture until it is known."""
KNOWN = 0.05
"""Relative standard deviation from which the focal length found so far replaces the guess."""

REGIONS = {(column, row) for column in range(3) for row in range(3)}
CELLS_OF_REGION = 3
"""Cells of a region, of GRID[0] * GRID[1] / 9, that must be covered."""
PLACES = {
    (0, 0): "in the upper left corner",
    (1, 0): "at the upper edge",
    (2, 0): "in the upper right corner",
    (0, 1): "at the left edge",
    (1, 1): "in the middle",
    (2, 1): "at the right edge",
    (0, 2): "in the lower left corner",
    (1, 2): "at the lower edge",
    (2, 2): "in the lower right corner",
}


@dataclass(frozen=True)
class Pose:
    """The place of the board in a view: its middle and its width in widths of the picture, and its
    tilts about the picture's axes, rad; positive with its left, and with its upper edge nearer.
    """

    x: float
    y: float
    width: float
    left: float
    upper: float

    def differs(self, other: Pose) -> bool:
        return (
            math.hypot(self.x - other.x, self.y - other.y) > NEW_PLACE
            or max(abs(self.left - other.left), abs(self.upper - other.upper)) > NEW_TILT
            or max(self.width / other.width, other.width / self.width) > NEW_SIZE
        )


@dataclass(frozen=True)
class Goal:
    """Something that the views must contain.

    Attributes:
        key: for programs. words: for a person with the board in the hands.
        fulfils: whether a pose does, for a tilt or a distance; None for a place in the picture.
        region: of the picture, (column, row) of 3 x 3, for a place.
    """

    key: str
    words: str
    fulfils: Callable[[Pose], bool] | None = None
    region: Cell = (1, 1)


MIDDLE = Goal("place-1-1", f"Hold the board {PLACES[1, 1]} of the picture")
MORE = Goal("more", "Hold the board in other places, with other tilts")
GOALS = (
    MIDDLE,
    Goal("left", "Tilt the board: its left edge towards the camera", lambda at: at.left > TILT),
    Goal("right", "Tilt the board: its right edge towards the camera", lambda at: at.left < -TILT),
    Goal("upper", "Tilt the board: its upper edge towards the camera", lambda at: at.upper > TILT),
    Goal("lower", "Tilt the board: its lower edge towards the camera", lambda at: at.upper < -TILT),
    Goal("near", "Bring the board closer, to fill the picture", lambda at: at.width > NEAR),
    Goal("far", "Hold the board farther away", lambda at: at.width < FAR),
    *(
        Goal(f"place-{column}-{row}", f"Hold the board {words} of the picture", None, (column, row))
        for (column, row), words in PLACES.items()
        if (column, row) != (1, 1)
    ),
)


class BoardGuide:
    """Takes views from pictures, until there are enough.

    Attributes:
        views: those taken.
        hint: what is wrong with the newest picture, or ""; for a person.
        corners: (N, 2) pixels of the board in the newest picture.
    """

    def __init__(self, board: Board) -> None:
        self._reader = BoardReader(board)
        self._board = board
        self.views: list[BoardView] = []
        self.hint = ""
        self.corners: Array = np.empty((0, 2))
        self._size = (0, 0)
        self._poses: list[Pose] = []
        self._cells: set[Cell] = set()
        self._rest: tuple[int, BoardView] | None = None  # since when, and where
        self._last_ns = 0
        self._so_far: CameraCalibration | None = None

    @property
    def goal(self) -> Goal | None:
        """Return the next view of the board that is needed; None when there are enough views."""
        missing = next((one for one in GOALS if not self._has(one)), None)
        if len(self.views) >= MOST_VIEWS:
            return None
        return MORE if missing is None and len(self.views) < ENOUGH_VIEWS else missing

    def look(self, grey: Picture, taken_ns: int) -> bool:
        """Handle a picture taken at that time, of any epoch; return whether its view was taken.

        Raises MeasurementError for a picture of another size than the ones before.
        """
        size = grey.shape[1], grey.shape[0]
        if self._size not in ((0, 0), size):
            raise MeasurementError(
                f"a picture of {size[0]} x {size[1]} pixels after those of {self._size[0]} x "
                f"{self._size[1]}: leave the camera's resolution as it is, and begin again"
            )
        self._size = size
        view, self.hint = self._reader.read(grey)
        self.corners = np.empty((0, 2)) if view is None else view.pixels
        if view is None or not self._is_still(view, taken_ns):
            self._last_ns = taken_ns
            return False
        self._last_ns = taken_ns
        pose, cells = self._pose(view), cells_of(view, size)
        if self.goal is None or not self._adds(pose, cells):
            return False
        self.views.append(view)
        self._poses.append(pose)
        self._cells |= cells
        if len(self.views) >= FEWEST_VIEWS:
            self._so_far = calibrate_camera(self.views, size)
        return True

    def result(self) -> CameraCalibration:
        """Return the intrinsics from the views taken. Raises MeasurementError."""
        return calibrate_camera(self.views, self._size)

    def state(self) -> dict[str, Any]:
        """Return the progress as plain data: `cells` are rows of GRID, `share` is 0 to 1, the
        residual so far in pixels, null before there is one.
        """
        done = [self._has(one) for one in GOALS]
        goal = self.goal
        return {
            "views": len(self.views),
            "share": (sum(done) + len(self.views))
            / (len(done) + max(len(self.views), ENOUGH_VIEWS)),
            "cells": [[(c, r) in self._cells for c in range(GRID[0])] for r in range(GRID[1])],
            "goals": {one.key: is_done for one, is_done in zip(GOALS, done, strict=True)},
            "goal": "" if goal is None else goal.key,
            "instruction": "" if goal is None else goal.words,
            "hint": self.hint,
            "residual": None if self._so_far is None else self._so_far.residual,
        }

    def _has(self, goal: Goal) -> bool:
        if goal.fulfils is not None:
            return any(map(goal.fulfils, self._poses))
        wide, high = GRID[0] // 3, GRID[1] // 3
        column, row = goal.region
        inside = [(c, r) for c, r in self._cells if (c // wide, r // high) == (column, row)]
        return len(inside) >= CELLS_OF_REGION

    def _adds(self, pose: Pose, cells: set[Cell]) -> bool:
        missing = [one for one in GOALS if not self._has(one)]
        if any(one.fulfils is not None and one.fulfils(pose) for one in missing):
            return True
        if len(cells - self._cells) >= NEW_CELLS:
            return True
        return not missing and all(map(pose.differs, self._poses))

    def _is_still(self, view: BoardView, taken_ns: int) -> bool:
        if self._rest is None or not 0 < taken_ns - self._last_ns < PAUSE_NS:
            self._rest = taken_ns, view
        since, start = self._rest
        _, here, there = np.intersect1d(view.numbers, start.numbers, return_indices=True)
        moved = np.linalg.norm(view.pixels[here] - start.pixels[there], axis=1)
        if not len(moved) or np.median(moved) > STILL_SHIFT * self._size[0]:
            self._rest = taken_ns, view
            self.hint = "Hold the board still"
            return False
        return taken_ns - since >= STILL_NS

    def _pose(self, view: BoardView) -> Pose:
        import cv2

        width, height = self._size
        focal, center, bends = FIRST_GUESS * width, (0.5 * width, 0.5 * height), np.zeros(5)
        found = self._so_far
        if found is not None and found.focal_deviation < KNOWN * found.matrix[0]:
            focal, center = found.matrix[0], (found.matrix[2], found.matrix[5])
            bends = np.array(found.distortion)
        K = np.array([[focal, 0.0, center[0]], [0.0, focal, center[1]], [0.0, 0.0, 1.0]])
        middle = 0.5 * np.array([*self._board.size, 0.0])
        _, turn, place = cv2.solvePnP(
            view.on_board - middle, view.pixels, K, bends, flags=cv2.SOLVEPNP_IPPE
        )
        R_cb, _ = cv2.Rodrigues(turn)
        x, y, depth = np.ravel(place).tolist()
        toward = -R_cb[:, 2]  # out of the board's face
        return Pose(
            focal * x / depth / width,
            focal * y / depth / width,
            max(self._board.size) * focal / depth / width,
            math.asin(max(-1.0, min(1.0, float(toward[0])))),
            math.asin(max(-1.0, min(1.0, float(toward[1])))),
        )
