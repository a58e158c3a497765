"""Corners of a tag to a few hundredths of a pixel, from its whole picture.

A detector's corners of a small tag are off by half a pixel, because a window around a corner is
quickly as large as the tag's cells. The printed picture is known, and its inner edges contain more
information than its outline: a blurred copy of it is overlaid on the camera's picture, and the
homography is refined by Gauss-Newton on the differences in brightness. S. Baker and I. Matthews,
"Lucas-Kanade 20 years on: a unifying framework" (2004), the inverse compositional step.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from estimation.tags.intrinsics import Intrinsics
from quadrotor.records import Array

Picture = npt.NDArray[np.uint8]

PLACES = 4
"""Places at which a cell is compared, along each axis."""
BLURS = (1.5, 1.5, 1.0, *(0.75,) * 6)
"""Blur of the overlaid picture in each step, pixels: larger at first, to correct errors
of a pixel."""
RIM = 0.2
"""Cells of the rim that are left out."""
SETTLED = 1e-3
"""Limit below which a step that turns, shears or moves (cells) the tag is the last."""
LEAST = 10.0
"""Smallest contrast, in grey levels between black and white."""
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def refine_corners(grey: Picture, corners: Array, tag: Picture, lens: Intrinsics) -> Array | None:
    """Return corners (4, 2), pixels, in the order of `TagDetector.detect`; None when the picture
    does not fit.

    The given ones must be within half a cell and a pixel.

    Args:
        tag: its upright picture, one pixel per cell, with the border and the rim.
    """
    import cv2

    cells, half = len(tag) + 2, 0.5 * len(tag)
    tag = np.pad(tag, 1, mode="edge")
    at = (np.arange(PLACES * cells) + 0.5) / PLACES - 0.5 * cells  # cells, from the middle
    at = at[np.abs(at) < half - RIM]
    u, v = np.meshgrid(at, at)
    one = np.ones(u.shape)
    outline = SQUARE * (half - 1.0)
    plane = cv2.undistortPoints(corners[:, None], lens.matrix, lens.distortion)[:, 0]
    flat = outline.astype(np.float32), plane.astype(np.float32)
    H = np.asarray(cv2.getPerspectiveTransform(*flat), float)
    cell = corners.T @ SQUARE / (4.0 * (half - 1.0))  # pixels along u and v
    blur_u, blur_v = np.linalg.norm(np.linalg.inv(cell), axis=1)
    none: Any = None
    for blur in BLURS:
        pixels = _pixels(H, np.column_stack([u.ravel(), v.ravel()]), lens).astype(np.float32)
        seen = cv2.remap(
            grey, pixels[:, None], none, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        )
        over, slope_u = _smoothed(at, cells, blur * blur_u)
        down, slope_v = _smoothed(at, cells, blur * blur_v)
        drawn, along_u, along_v = (
            down @ tag @ over.T,
            down @ tag @ slope_u.T,
            slope_v @ tag @ over.T,
        )
        # The surroundings of the rim may have any brightness.
        inside = np.outer(down[:, 1:-1].sum(axis=1), over[:, 1:-1].sum(axis=1))
        both = -u * along_u - v * along_v
        moves = [along_u, u * along_u, v * along_u, along_v, u * along_v, v * along_v]
        A = np.stack([*moves, u * both, v * both, drawn, inside, one]).reshape(11, -1)
        *step, contrast, _, _ = np.linalg.lstsq(A @ A.T, A @ seen[:, 0])[0]
        if contrast * 255.0 < LEAST:
            return None
        a = np.array(step) / contrast
        off = np.array([[1 + a[1], a[2], a[0]], [a[4], 1 + a[5], a[3]], [a[6], a[7], 1]])
        H = H @ np.linalg.inv(off)
        if blur == BLURS[-1] and np.abs(a).max() < SETTLED:
            break
    found = _pixels(H, outline, lens)
    near = np.abs(found - corners).max() < 0.5 * np.abs(cell).max() + 1.0
    return found if near else None


def _pixels(H: Array, places: Array, lens: Intrinsics) -> Array:
    import cv2

    rays = np.column_stack([places, np.ones(len(places))]) @ H.T
    zero = np.zeros(3)
    pixels, _ = cv2.projectPoints(rays / rays[:, 2:], zero, zero, lens.matrix, lens.distortion)
    return np.asarray(pixels[:, 0], float)


def _smoothed(at: Array, cells: int, blur: float) -> tuple[Array, Array]:
    """Return the shares (places, cells) of the cells in a blurred picture, and their slopes."""
    from scipy.special import erf  # late: it takes 0.2 s, and flights without a camera need none

    x = (at[:, None] - (np.arange(cells + 1) - 0.5 * cells)) / blur
    slope = np.exp(-0.5 * x * x) / (np.sqrt(2.0 * np.pi) * blur)
    return -np.diff(0.5 * erf(x / np.sqrt(2.0)), axis=1), -np.diff(slope, axis=1)
