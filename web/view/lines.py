"""Lines of the 3D view: their colours, and the edges of a box."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from control.behaviors.parameters import Box

PLANNED, REFUSED = (157, 120, 210), (214, 90, 80)
"""Colours of what may be flown next, and of what the vehicle would refuse, sRGB."""


def line_color(color: tuple[int, int, int]) -> tuple[int, int, int]:
    """Return the colour with which a viser line looks like this sRGB colour.

    Lines look brighter than their colour. The exponent was found by eye next to the page's own
    colours.
    """
    red, green, blue = (round(255.0 * (c / 255.0) ** 1.4) for c in color)
    return (red, green, blue)


def edges(box: Box) -> npt.NDArray[np.float32]:
    """Return the 12 edges of a box, shape (12, 2, 3)."""
    corners = np.array(np.meshgrid(*box, indexing="ij"), np.float32).reshape(3, 2, 2, 2)
    edges = [
        corners.swapaxes(1, axis + 1)[:, :, i, j].T
        for axis in range(3)
        for i in (0, 1)
        for j in (0, 1)
    ]
    return np.stack(edges)
