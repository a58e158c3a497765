"""Figures of how well a camera sees, and the text in which process and page show them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from estimation.tags.detector import wrong_exposure


class Figures(NamedTuple):
    """The figures of a camera's last second; NaN when unknown.

    Attributes:
        name: of the camera; "" of the only one.
        picture_rate: pictures a second, including unused ones; Hz.
        tags_share: share of these pictures with a tag, 0 to 1.
        grey_level: mean of the newest picture, 0 black to 255 white.
        residual: deviation of tags from their places, pixels rms, median of the pictures.
    """

    name: str = ""
    picture_rate: float = math.nan
    tags_share: float = math.nan
    grey_level: float = math.nan
    residual: float = math.nan


def figures_text(figures: Figures | Any, markers: str = "tags") -> str:
    """Return the figures, also those of a TrackerStatus, in one line.

    Args:
        markers: what the camera looks for.
    """
    name = f"camera {figures.name}: " if figures.name else ""
    if not figures.picture_rate:
        return f"{name}no pictures"
    exposure, left = wrong_exposure(figures.grey_level), figures.residual
    level = f"mean grey level {figures.grey_level:.0f} of 255"
    off = f", {left:.2f} pixels from their places" if math.isfinite(left) else ""
    return (
        f"{name}{figures.picture_rate:.0f} pictures/s, {level}"
        f"{exposure and f' ({exposure})'}, {markers} in {figures.tags_share:.0%} of them{off}"
    )
