"""The exposure of a picture: black, white or usable."""

from __future__ import annotations

DARK, BRIGHT = 12.0, 243.0
"""Mean grey levels beyond which the exposure is wrong."""


def wrong_exposure(level: float) -> str:
    """Return "black" or "white" for a mean grey level (0 to 255) that is unusable, else ""."""
    return "black" if level <= DARK else "white" if level >= BRIGHT else ""
