"""A camera's intrinsics from views of a ChArUco board.

Z. Zhang, "A flexible new technique for camera calibration" (2000); OpenCV solves the least squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from extensions.vision.tags.charuco import BoardView
from extensions.vision.tags.intrinsics import Intrinsics
from quadrotor.errors import MeasurementError

FEWEST_VIEWS = 8
GRID = (9, 6)
"""Cells of the picture, across and down, for the coverage."""
COVERAGE_MIN = 0.4
RESIDUAL_MAX = 1.0
"""Largest good residual, pixels rms."""
FOCAL_DEVIATION_MAX = 0.005
"""Largest good standard deviation of the focal length, relative to it."""

Cell = tuple[int, int]


@dataclass(frozen=True)
class CameraCalibration:
    """Calibrated intrinsics and their quality, as plain data that crosses processes.

    Attributes:
        width, height: of the picture, pixels.
        matrix: nine numbers, row by row, pixels. distortion: k1, k2, p1, p2, k3.
        residual: rms distance of the corners from the model's, pixels.
        coverage: share of GRID's cells with a corner in them.
        views: number of views used.
        focal_deviation: standard deviation of the focal length, pixels.
        corners: x, y of each corner, and the distance of the model from it, pixels.
        worst_view: largest rms distance in one view, pixels.
    """

    width: int
    height: int
    matrix: tuple[float, ...]
    distortion: tuple[float, ...]
    residual: float
    coverage: float
    views: int
    focal_deviation: float
    corners: tuple[tuple[float, float, float, float], ...]
    worst_view: float

    @property
    def intrinsics(self) -> Intrinsics:
        matrix = np.reshape(self.matrix, (3, 3))
        return Intrinsics(self.width, self.height, matrix, np.array(self.distortion))

    @property
    def focal_lengths(self) -> tuple[float, float]:
        """Return the focal lengths along x and y, pixels."""
        return self.matrix[0], self.matrix[4]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return what is not good enough, with what to do."""
        found = []
        if self.residual >= RESIDUAL_MAX:
            found.append(
                f"{self.residual:.1f} pixels are left, at most {RESIDUAL_MAX:g}: the board bends, "
                "moves in a picture, or has other squares than given"
            )
        if self.coverage < COVERAGE_MIN:
            found.append(
                f"the board was in {self.coverage:.0%} of the picture, {COVERAGE_MIN:.0%} are "
                "needed: bring it to its edges and corners as well"
            )
        deviation = self.focal_deviation / self.matrix[0]
        if deviation > FOCAL_DEVIATION_MAX:
            found.append(
                f"the focal length is known to ± {deviation:.1%}, allowed "
                f"± {FOCAL_DEVIATION_MAX:.1%}: tilt the board more, and bring it closer"
            )
        return tuple(found)


def cells_of(view: BoardView, size: tuple[int, int]) -> set[Cell]:
    """Return the cells of GRID, (column, row), with a corner in a picture of `size` pixels."""
    at = (view.pixels + 0.5) * (GRID[0] / size[0], GRID[1] / size[1])
    inside = np.clip(at.astype(int), 0, (GRID[0] - 1, GRID[1] - 1))
    return {(int(column), int(row)) for column, row in inside}


def calibrate_camera(views: Sequence[BoardView], size: tuple[int, int]) -> CameraCalibration:
    """Return the intrinsics from views of the board in pictures of `size`, pixels.

    Raises MeasurementError when there are too few, or they determine no intrinsics.
    """
    import cv2

    if len(views) < FEWEST_VIEWS:
        raise MeasurementError(
            f"the board was taken in {len(views)} pictures, {FEWEST_VIEWS} are needed: hold it "
            "still in more places"
        )
    points = [np.asarray(one.on_board, np.float32)[:, None] for one in views]
    pixels = [np.asarray(one.pixels, np.float32)[:, None] for one in views]
    start = np.eye(3), np.zeros(5)
    residual, matrix, distortion, turns, places, deviations, _, of_views = (
        cv2.calibrateCameraExtended(points, pixels, size, *start)
    )
    if not (np.isfinite(residual) and np.isfinite(matrix).all() and matrix[0, 0] > 1.0):
        raise MeasurementError("the pictures determine no intrinsics: tilt the board more, again")
    corners = []
    for view, turn, place in zip(views, turns, places, strict=True):
        model, _ = cv2.projectPoints(view.on_board, turn, place, matrix, distortion)
        corners.append(np.column_stack([view.pixels, model.reshape(-1, 2) - view.pixels]))
    covered = set[Cell]().union(*(cells_of(one, size) for one in views))
    return CameraCalibration(
        *size,
        matrix=tuple(np.ravel(matrix).tolist()),
        distortion=tuple(np.ravel(distortion)[:5].tolist()),
        residual=float(residual),
        coverage=len(covered) / (GRID[0] * GRID[1]),
        views=len(views),
        focal_deviation=float(np.ravel(deviations)[0]),
        corners=tuple(
            (x, y, right, down) for x, y, right, down in np.concatenate(corners).tolist()
        ),
        worst_view=float(np.max(of_views)),
    )
