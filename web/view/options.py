"""Options of the 3D view: what is drawn of the flight, and what the flown path's colour means."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Signal = Literal["none", "error", "speed", "thrust"]
RANGES: dict[str, tuple[float, float, str]] = {
    "error": (0.0, 0.1, "m"),
    "speed": (0.0, 2.0, "m/s"),
    "thrust": (0.8, 1.2, "× weight"),
}
"""Ends and unit of each signal's colours; web/static/view/path_color.js has the same."""
RAMP = ((64, 120, 200), (64, 192, 160), (230, 190, 80), (229, 90, 80))
"""Colours from low to high, sRGB."""


@dataclass(frozen=True)
class ViewOptions:
    """The options of the 3D view, the same for all pages.

    Attributes:
        error: the vector from the estimate to the reference, `magnified`.
        color: the signal that colours the flown path.
    """

    flown: bool = True
    reference: bool = True
    truth: bool = True
    volume: bool = True
    ground: bool = True
    error: bool = False
    magnified: int = 10
    color: Signal = "none"


def ramp(signal: str, value: float) -> tuple[int, int, int]:
    """Return the colour of a signal's value."""
    low, high, _ = RANGES[signal]
    at = max(0.0, min(1.0, (value - low) / (high - low))) * (len(RAMP) - 1)
    k = min(int(at), len(RAMP) - 2)
    red, green, blue = (
        round(a + (at - k) * (b - a)) for a, b in zip(*RAMP[k : k + 2], strict=True)
    )
    return red, green, blue
