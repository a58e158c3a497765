"""Figures of how well a camera sees, and the text in which process and page show them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from estimation.tags.detector import wrong_exposure


class Figures(NamedTuple):
    """The figures of a camera's last second; NaN when unknown.

    Attributes:
        is_camera: False for a system without a camera.
        picture_rate: pictures a second, including unused ones; Hz.
        tags_share: share of these pictures with a tag, 0 to 1.
        grey_level: mean of the newest picture, 0 black to 255 white.
        residual: deviation of tags from their places, pixels rms, median of the pictures.
    """

    is_camera: bool = False
    picture_rate: float = math.nan
    tags_share: float = math.nan
    grey_level: float = math.nan
    residual: float = math.nan


def figures_text(figures: Figures | Any) -> str:
    """Return the figures, also those of a TrackerStatus, in one line; "" without a camera."""
    if not figures.is_camera:
        return ""
    if not figures.picture_rate:
        return "no pictures"
    exposure, left = wrong_exposure(figures.grey_level), figures.residual
    off = f", {left:.2f} pixels from their places" if math.isfinite(left) else ""
    return (
        f"{figures.picture_rate:.0f} pictures/s, mean grey level {figures.grey_level:.0f} of 255"
        f"{exposure and f' ({exposure})'}, tags in {figures.tags_share:.0%} of them{off}"
    )
