"""Corners of a tag to a few hundredths of a pixel, from its whole picture.

A detector's corners of a small tag are off by half a pixel, because a window around a corner is
quickly as large as the tag's cells. The printed picture is known, and its inner edges contain more
information than its outline: a blurred copy of it is overlaid on the camera's picture, and the
homography is refined by Gauss-Newton on the differences in brightness. S. Baker and I. Matthews,
"Lucas-Kanade 20 years on: a unifying framework" (2004), the inverse compositional step. The last
steps also find the blur of the lens: a tag seen from the side looks smaller with a wrong one, and
is then found too far away.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from extensions.vision.tags.intrinsics import Intrinsics
from quadrotor.records import Array

Picture = npt.NDArray[np.uint8]

PLACES = 4
"""Places at which a cell is compared, along each axis."""
BLURS = (1.5, 1.0, 0.75)
"""Blur of the overlaid picture in each step, pixels: larger at first, to correct errors of a pixel.
The steps after them find it."""
STEPS = 6
"""Largest number of steps that find the blur."""
SHARPEST, WIDEST = 0.4, 2.0
"""Blurs between which it is searched, pixels."""
BLUR_STEP, BLUR_SETTLED = 0.6, 0.02
"""Largest step of the logarithm of the blur's variance, and the limit below which one is the last.
"""
LARGEST_CELL = 10.0
"""Pixels per cell up to which those blurs reach from one compared place to the next. The picture of
a nearer tag is blurred in proportion, and so are the limits above.
"""
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
    whole = np.pad(np.ones((cells - 2, cells - 2)), 1)
    outline = SQUARE * (half - 1.0)
    plane = cv2.undistortPoints(corners[:, None], lens.matrix, lens.distortion)[:, 0]
    flat = outline.astype(np.float32), plane.astype(np.float32)
    H = np.asarray(cv2.getPerspectiveTransform(*flat), float)
    cell = corners.T @ SQUARE / (4.0 * (half - 1.0))  # pixels along u and v
    # A blur that is round in the picture is not in the tag: variances and covariance, cells^2.
    to_cells = np.linalg.inv(cell)
    (uu, uv), (_, vv) = to_cells @ to_cells.T
    scale = max(1.0, float(np.sqrt(np.abs(np.linalg.det(cell)))) / LARGEST_CELL)
    if scale > 1.0:
        grey = np.asarray(cv2.GaussianBlur(grey, (0, 0), math.sqrt(scale * scale - 1.0)), np.uint8)
    blur, surroundings = BLURS[0], 0.0
    none: Any = None
    for start in (*BLURS, *(None,) * STEPS):
        blur = blur if start is None else start * scale
        pixels = _pixels(H, np.column_stack([u.ravel(), v.ravel()]), lens).astype(np.float32)
        seen = cv2.remap(
            grey, pixels[:, None], none, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        )
        over = _smoothed(at, cells, blur * np.sqrt(uu))
        down = _smoothed(at, cells, blur * np.sqrt(vv))
        shares = blur * blur * np.array([0.5 * uu, 0.0 if start else uv, 0.5 * vv])
        drawn, along_u, along_v, wider = _drawn(tag, over, down, shares)
        # The surroundings of the rim may have any brightness.
        inside, _, _, inside_wider = _drawn(whole, over, down, shares)
        both = -u * along_u - v * along_v
        moves = [along_u, u * along_u, v * along_u, along_v, u * along_v, v * along_v]
        blurred = wider + surroundings * inside_wider
        moves += [u * both, v * both, *([blurred] if start is None else [])]
        A = np.stack([*moves, drawn, inside, np.ones(u.shape)]).reshape(len(moves) + 3, -1)
        *step, contrast, rim, _ = np.linalg.lstsq(A @ A.T, A @ seen[:, 0])[0]
        if contrast * 255.0 < LEAST:
            return None
        a = np.array(step) / contrast
        H = H @ np.linalg.inv(_homography(a))
        if start is None:
            surroundings = rim / contrast
            step_of_blur = min(max(a[8], -BLUR_STEP), BLUR_STEP)
            blur = min(max(blur * math.exp(0.5 * step_of_blur), SHARPEST * scale), WIDEST * scale)
            if np.abs(a[:8]).max() < SETTLED and abs(a[8]) < BLUR_SETTLED:
                break
    found = _pixels(H, outline, lens)
    near = np.abs(found - corners).max() < 0.5 * np.abs(cell).max() + 1.0
    return found if near else None


def _homography(a: Array) -> Array:
    """Return the homography (3, 3) of a step: 8 differences from the identity."""
    return np.array([[1 + a[1], a[2], a[0]], [a[4], 1 + a[5], a[3]], [a[6], a[7], 1]])


def _pixels(H: Array, places: Array, lens: Intrinsics) -> Array:
    return lens.project(np.column_stack([places, np.ones(len(places))]) @ H.T)


def _drawn(
    cells: Array | Picture, over: Sequence[Array], down: Sequence[Array], shares: Array
) -> tuple[Array, Array, Array, Array]:
    """Return a blurred picture of cells, its slopes along u and v, and its change with the
    logarithm of the blur's variance.

    Args:
        over, down: of `_smoothed`, along u and v.
        shares: half the blur's variance along u, its covariance, half its variance along v.
    """
    along_u, along_v = down[0] @ cells @ over[1].T, down[1] @ cells @ over[0].T
    across = shares[1] * (down[1] @ cells @ over[1].T)
    wider = shares[0] * (down[0] @ cells @ over[2].T) + shares[2] * (down[2] @ cells @ over[0].T)
    return down[0] @ cells @ over[0].T + across, along_u, along_v, wider + across


def _smoothed(at: Array, cells: int, blur: float) -> tuple[Array, Array, Array]:
    """Return the shares (places, cells) of the cells in a blurred picture, and their first and
    second derivatives.
    """
    from scipy.special import erf  # late: it takes 0.2 s, and flights without a camera need none

    x = (at[:, None] - (np.arange(cells + 1) - 0.5 * cells)) / blur
    slope = np.exp(-0.5 * x * x) / (np.sqrt(2.0 * np.pi) * blur)
    bend = -x / blur * slope
    return tuple(-np.diff(one, axis=1) for one in (0.5 * erf(x / np.sqrt(2.0)), slope, bend))
