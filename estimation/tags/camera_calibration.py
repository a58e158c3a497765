"""A camera's intrinsics from pictures of a ChArUco board.

Z. Zhang, "A flexible new technique for camera calibration" (2000); OpenCV detects the board's
corners and solves the least squares.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from estimation.tags.detector import Picture, dictionary_of
from estimation.tags.intrinsics import Intrinsics
from quadrotor.errors import MeasurementError

BOARD_FAMILY = "4X4_250"
FEWEST_PICTURES, FEWEST_CORNERS = 8, 8
GRID = (8, 6)
"""Cells of the picture, across and down, for the coverage."""
COVERAGE_MIN = 0.4
RESIDUAL_MAX = 1.0
"""Largest residual, pixels rms."""


@dataclass(frozen=True)
class Board:
    """A ChArUco board: squares across and down, side of a square and of the markers in it, m."""

    columns: int
    rows: int
    square: float
    marker: float


@dataclass(frozen=True, eq=False)
class CameraCalibration:
    """The calibrated intrinsics and their quality.

    Attributes:
        residual: rms distance of the corners from the model's, pixels.
        coverage: share of GRID's cells with a corner in them.
        pictures: number of pictures used.
        focal_deviation: standard deviation of the focal length, pixels.
    """

    intrinsics: Intrinsics
    residual: float
    coverage: float
    pictures: int
    focal_deviation: float


def calibrate_camera(pictures: Iterable[Picture], board: Board) -> CameraCalibration:
    """Return the intrinsics. Raises MeasurementError when the pictures do not determine them."""
    import cv2

    if not (min(board.columns, board.rows) >= 3 and 0.0 < board.marker < board.square):
        raise MeasurementError(
            f"{board} is no ChArUco board: it has 3 squares or more each way, and markers smaller "
            "than the squares"
        )
    size = board.columns, board.rows
    charuco = cv2.aruco.CharucoBoard(size, board.square, board.marker, dictionary_of(BOARD_FAMILY))
    detector = cv2.aruco.CharucoDetector(charuco)
    points, pixels, shape = [], [], (0, 0)
    for grey in pictures:
        if shape not in ((0, 0), grey.shape):
            raise MeasurementError("pictures of several sizes; give those of one camera")
        shape = (grey.shape[0], grey.shape[1])
        corners, numbers, _, _ = detector.detectBoard(grey)
        if numbers is not None and len(numbers) >= FEWEST_CORNERS:
            on_board, seen = charuco.matchImagePoints(list(corners), numbers)
            points.append(on_board)
            pixels.append(seen)
    if len(points) < FEWEST_PICTURES:
        raise MeasurementError(
            f"the board is seen in {len(points)} pictures, {FEWEST_PICTURES} are needed; check "
            "its squares and the light, and take more"
        )
    height, width = shape
    all_seen = np.concatenate(pixels).reshape(-1, 2)
    cells = np.unique((all_seen * (GRID[0] / width, GRID[1] / height)).astype(int), axis=0)
    coverage = len(cells) / (GRID[0] * GRID[1])
    if coverage < COVERAGE_MIN:
        raise MeasurementError(
            f"the board was in {coverage:.0%} of the picture, {COVERAGE_MIN:.0%} are needed; bring "
            "it to its edges and corners as well"
        )
    start = np.eye(3), np.zeros(5)
    residual, matrix, distortion, _, _, deviations, _, _ = cv2.calibrateCameraExtended(
        points, pixels, (width, height), *start
    )
    if not residual < RESIDUAL_MAX:
        raise MeasurementError(
            f"{residual:.1f} pixels are left, allowed {RESIDUAL_MAX:g}: the board is bent, or its "
            "squares are not as given"
        )
    found = Intrinsics(
        width, height, np.asarray(matrix, float), np.asarray(distortion, float).ravel()[:5]
    )
    return CameraCalibration(
        found, float(residual), coverage, len(points), float(np.ravel(deviations)[0])
    )
