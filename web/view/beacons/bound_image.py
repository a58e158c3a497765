"""Observability map as a picture: muted colours, ordered by lightness, on a logarithmic scale.

Light means well determined, dark badly; what is not determined is left transparent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

COLORS = ((199, 233, 205), (126, 197, 184), (70, 152, 163), (48, 108, 138), (43, 66, 103))
"""sRGB, from the smallest bound to the largest; lightness falls evenly."""
BEYOND = (40, 42, 62)
OPACITY = 0.5
STEPS = 24
"""Number of shades: few, so that their edges look like contour lines and the picture is small."""
NICE = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0)


@dataclass(frozen=True)
class Scale:
    """Ends of the colour scale, m."""

    low: float
    high: float

    @classmethod
    def of(cls, bound: npt.NDArray[np.float64]) -> Scale | None:
        """Return round ends around most of a map, or None if nothing is determined."""
        known = bound[np.isfinite(bound)]
        if not len(known):
            return None
        low, high = np.percentile(known, (1.0, 97.0))
        low, high = round_down(float(low)), round_up(float(high))
        return cls(low, high if high > low else 2.0 * low)

    def share(self, bound: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return 0 at the low end, 1 at the high end, logarithmic in between and not clipped."""
        shares: npt.NDArray[np.float64] = np.log(bound / self.low) / math.log(self.high / self.low)
        return shares


def picture(bound: npt.NDArray[np.float64], scale: Scale) -> npt.NDArray[np.uint8]:
    """Return (ny, nx, 4) RGBA of bounds in m, (ny, nx); NaN is transparent."""
    share = scale.share(np.where(np.isfinite(bound), bound, scale.low))
    shade = np.clip((share * STEPS).astype(int), 0, STEPS - 1)
    colors = np.array([shade_of((k + 0.5) / STEPS) for k in range(STEPS)], np.uint8)
    image = np.empty((*bound.shape, 4), np.uint8)
    image[..., :3] = np.where((share > 1.0)[..., None], np.array(BEYOND, np.uint8), colors[shade])
    image[..., 3] = np.where(np.isfinite(bound), round(255 * OPACITY), 0)
    return image


def shade_of(share: float) -> tuple[int, int, int]:
    """Return the colour at a share of the scale."""
    places = np.linspace(0.0, 1.0, len(COLORS))
    r, g, b = (round(float(np.interp(share, places, one))) for one in zip(*COLORS, strict=True))
    return (r, g, b)


def legend(scale: Scale) -> dict[str, object]:
    """Return the legend for the page: ends in m, colours from low to high, and beyond the end."""
    return {
        "low": scale.low,
        "high": scale.high,
        "unit": "m",
        "scale": "log",
        "colors": [hex_of(color) for color in COLORS],
        "beyond": hex_of(BEYOND),
    }


def hex_of(color: tuple[int, int, int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*color)


def round_down(value: float) -> float:
    """Return the largest round number that is not above the value."""
    decade = 10.0 ** math.floor(math.log10(value))
    return max((n * decade for n in NICE if n * decade <= value * (1 + 1e-9)), default=decade)


def round_up(value: float) -> float:
    """Return the smallest round number that is not below the value."""
    decade = 10.0 ** math.floor(math.log10(value))
    return min(n * decade for n in NICE if n * decade >= value * (1 - 1e-9))
