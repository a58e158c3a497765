"""Pictures of a tracker's cameras for people, and figures of how well they see."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

DARK, BRIGHT = 12.0, 243.0
"""Mean grey levels beyond which the exposure is wrong."""


def wrong_exposure(level: float) -> str:
    """Return "black" or "white" for a mean grey level (0 to 255) that is unusable, else ""."""
    return "black" if level <= DARK else "white" if level >= BRIGHT else ""


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


class CameraPicture(NamedTuple):
    """A picture to be shown."""

    taken_ns: int
    """Time of the picture on the host's steady clock."""
    jpeg: bytes


class View(Protocol):
    """A camera as people see it; its source fills it from another thread.

    Attributes:
        is_watched: whether pictures are made; set by their sender.
        newest: the newest picture that was made.
    """

    is_watched: bool
    newest: CameraPicture | None

    def figures(self) -> Figures:
        """Return the present figures of the camera."""
        ...


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
