"""A ChArUco board: its dimensions, and its corners in a picture.

S. Garrido-Jurado et al., "Automatic generation and detection of highly reliable fiducial markers
under occlusion" (2014); OpenCV detects the markers and refines the corners between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from console.trackers.camera_figures import wrong_exposure
from extensions.vision.tags.detector import Picture, Tags, dictionary_of
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

BOARD_FAMILY = "4X4_250"
MARKERS_MAX = 250
SQUARES = (3, 30)
SQUARE = (0.005, 0.5)
"""Smallest and largest side of a square, m."""
FEWEST_CORNERS = 8
"""Fewest corners of a picture that is used."""
CHECKED = 6
"""Fewest markers from which the board's dimensions are checked."""
MISPLACED = 0.3
"""Squares by which half of the markers may leave their places on the board."""
RATIO_ERROR = 0.1
"""Relative error allowed of a marker's side over a square's."""


@dataclass(frozen=True)
class Board:
    """A ChArUco board: squares across and down, side of a square and of the markers in it, m.

    Raises MeasurementError for dimensions that no board has.
    """

    columns: int = 7
    rows: int = 5
    square: float = 0.035
    marker: float = 0.026

    def __post_init__(self) -> None:
        least, most = SQUARES
        if not (least <= min(self.columns, self.rows) and max(self.columns, self.rows) <= most):
            raise MeasurementError(
                f"a board of {self.columns} x {self.rows} squares is not possible: allowed are "
                f"{least} to {most} each way"
            )
        if self.marker_count > MARKERS_MAX:
            raise MeasurementError(
                f"a board of {self.columns} x {self.rows} squares needs {self.marker_count} "
                f"markers, but DICT_{BOARD_FAMILY} has {MARKERS_MAX}; use fewer squares"
            )
        if not SQUARE[0] <= self.square <= SQUARE[1]:
            raise MeasurementError(
                f"squares of {1e3 * self.square:g} mm are not possible: allowed are "
                f"{1e3 * SQUARE[0]:g} to {1e3 * SQUARE[1]:g} mm"
            )
        if not 0.3 * self.square <= self.marker <= 0.95 * self.square:
            raise MeasurementError(
                f"markers of {1e3 * self.marker:g} mm in squares of {1e3 * self.square:g} mm are "
                "no ChArUco board: allowed are 0.3 to 0.95 of a square"
            )

    @property
    def marker_count(self) -> int:
        return self.columns * self.rows // 2

    @property
    def size(self) -> tuple[float, float]:
        """Return width and height, m."""
        return self.columns * self.square, self.rows * self.square

    def of_opencv(self) -> Any:
        import cv2

        size, dictionary = (self.columns, self.rows), dictionary_of(BOARD_FAMILY)
        return cv2.aruco.CharucoBoard(size, self.square, self.marker, dictionary)

    def picture(self, pixels: int = 120) -> Picture:
        """Return the board as it is printed, with so many pixels for a square."""
        size = self.columns * pixels, self.rows * pixels
        return np.asarray(self.of_opencv().generateImage(size), np.uint8)


@dataclass(frozen=True, eq=False)
class BoardView:
    """The board's corners in one picture.

    Attributes:
        numbers: (N,) of the corners.
        on_board: (N, 3) m, from the board's upper left corner: x right, y down, z into the board.
        pixels: (N, 2).
    """

    numbers: npt.NDArray[np.integer]
    on_board: Array
    pixels: Array


class BoardReader:
    """Finds a board's corners in pictures."""

    def __init__(self, board: Board) -> None:
        import cv2

        self.board = board
        self._charuco = board.of_opencv()
        self._detector: Any = cv2.aruco.CharucoDetector(self._charuco)
        numbers = np.ravel(self._charuco.getIds()).tolist()
        places = np.array(self._charuco.getObjPoints())[:, :, :2] / board.square
        self._places: Tags = dict(zip(numbers, places, strict=True))

    def read(self, grey: Picture) -> tuple[BoardView | None, str]:
        """Return the board in a picture, and why there is none that can be used, or ""."""
        corners, numbers, seen, marks = self._detector.detectBoard(grey)
        tags = {} if marks is None else dict(zip(np.ravel(marks).tolist(), seen, strict=True))
        if problem := self._mismatch({one: at.reshape(4, 2) for one, at in tags.items()}):
            return None, problem
        count = 0 if numbers is None else len(numbers)
        if count >= FEWEST_CORNERS:
            on_board, pixels = self._charuco.matchImagePoints(list(corners), numbers)
            return BoardView(np.ravel(numbers), on_board.reshape(-1, 3), pixels.reshape(-1, 2)), ""
        level = float(grey.mean())
        if not tags and (what := wrong_exposure(level)):
            return None, (
                f"The picture is {what} (mean grey level {level:.0f} of 255): check the lens's "
                "cap, the light and the exposure"
            )
        if not tags:
            return None, "No board is seen: hold it in front of the camera, with light on it"
        return (
            None,
            f"{count} corners of the board are seen, {FEWEST_CORNERS} are needed: show more",
        )

    def _mismatch(self, tags: Tags) -> str:
        """Return why these markers are of another board than the one given, or ""."""
        import cv2

        board = self.board
        name = f"a board of {board.columns} x {board.rows} squares"
        unknown = [number for number in tags if number not in self._places]
        if len(unknown) > 1:
            return (
                f"Marker {max(unknown)} is seen, but {name} has only 0 to "
                f"{len(self._places) - 1}: count its squares and give them"
            )
        known = [number for number in tags if number in self._places]
        if len(known) < CHECKED:
            return ""
        wanted = np.array([self._places[number].mean(axis=0) for number in known])
        seen = np.array([tags[number].mean(axis=0) for number in known])
        to_board: Any = cv2.findHomography(seen, wanted)[0]
        if to_board is None:  # all in one line
            return ""
        off = np.linalg.norm(_mapped(to_board, seen) - wanted, axis=1)
        if np.median(off) > MISPLACED:
            return f"The markers are not where {name} has them: count its squares and give them"
        outlines = [_mapped(to_board, tags[number]) for number in known]
        sides = [np.linalg.norm(one - np.roll(one, 1, axis=0), axis=1).mean() for one in outlines]
        ratio, given = float(np.median(sides)), board.marker / board.square
        if abs(ratio / given - 1.0) > RATIO_ERROR:
            return (
                f"The markers are {ratio:.2f} of a square wide, but {given:.2f} as given: "
                "measure marker and square, and give both"
            )
        return ""


def _mapped(homography: Any, points: Array) -> Array:
    """Return points (N, 2) mapped by a homography (3, 3)."""
    on = np.column_stack([points, np.ones(len(points))]) @ np.asarray(homography, float).T
    mapped: Array = on[:, :2] / on[:, 2:]
    return mapped
