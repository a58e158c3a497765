"""Units as files write them."""

from __future__ import annotations

import re

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
FORCE_UNITS = {"m/s^2": 1.0, "g": 9.80665, "mg": 9.80665e-3}
RATE_UNITS = {"rad/s": 1.0, "deg/s": 0.017453292519943295, "mdeg/s": 1.7453292519943295e-5}
LENGTH_UNITS = {"m": 1.0, "cm": 0.01, "mm": 1e-3, "ft": 0.3048}
OTHER_UNITS = frozenset({"m/s", "deg", "rad", "v", "mv", "a", "ma", "hz", "%", "pa", "hpa"})
WRITTEN = {
    "sec": "s",
    "second": "s",
    "seconds": "s",
    "msec": "ms",
    "usec": "us",
    "µs": "us",
    "μs": "us",
    "nsec": "ns",
    "m/s2": "m/s^2",
    "m/s/s": "m/s^2",
    "ms^-2": "m/s^2",
    "m*s^-2": "m/s^2",
    "rads^-1": "rad/s",
    "rad*s^-1": "rad/s",
    "radps": "rad/s",
    "dps": "deg/s",
    "°/s": "deg/s",
    "degs^-1": "deg/s",
    "mdps": "mdeg/s",
    "ms^-1": "m/s",
    "°": "deg",
    "º": "deg",
}
"""Other ways to write a unit, in lower case and without spaces."""


def unit_of(text: str) -> str | None:
    """Return a unit as mappings write it, of how a file writes it; None for what is no unit."""
    word = re.sub(r"\s+", "", text).lower().replace("²", "^2").replace("⁻¹", "^-1")
    word = WRITTEN.get(word, word)
    known = TIME_UNITS.keys() | FORCE_UNITS.keys() | RATE_UNITS.keys() | LENGTH_UNITS.keys()
    return word if word in known or word in OTHER_UNITS else None
