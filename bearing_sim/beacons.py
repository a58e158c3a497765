"""Layouts of beacons: presets by name, and the line of text that a parameter holds.

    paper
    1 1.0 1.0 0.1; 2 -1.0 1.0 0.1; 3 -1.0 -1.0 0.1; 4 1.0 -1.0 0.1

The second form is `id x y z` of each beacon, m in world axes, separated by semicolons.
"""

from __future__ import annotations

import math

from bearing_sim.beacon_set import Beacons
from quadrotor.errors import MeasurementError
from quadrotor.similar_names import did_you_mean

__all__ = ["PAPER_BEACONS", "PRESETS", "Beacons", "format_layout", "parse_layout"]

LONGEST = 4096
"""Longest layout in characters; MAX_BEACONS in full precision take half of it."""
_SHOWN = 40
"""Number of characters of a wrong text that its error message repeats."""


def _square(half: float, height: float) -> Beacons:
    corners = ((half, half), (-half, half), (-half, -half), (half, -half))
    return Beacons([1, 2, 3, 4], [(x, y, height) for x, y in corners])


def _circle(count: int, radius: float, height: float) -> Beacons:
    """Return beacons spaced evenly on a circle, positions to the millimetre."""
    angles = [math.pi / count + 2.0 * math.pi * k / count for k in range(count)]
    places = [
        (round(radius * math.cos(a), 3), round(radius * math.sin(a), 3), height) for a in angles
    ]
    return Beacons(list(range(1, count + 1)), places)


PAPER_BEACONS = _square(1.0, 0.1)
"""The paper's Sec. 7: 4 beacons 10 cm above the ground on a square of 2 m."""

PRESETS: dict[str, Beacons] = {
    "paper": PAPER_BEACONS,
    "wide": _square(2.0, 0.1),
    "eight": _circle(8, 1.5, 0.1),
    "ceiling": _square(1.0, 2.8),
    "wall": Beacons(
        [1, 2, 3, 4], [(2.5, 1.0, 0.5), (2.5, -1.0, 0.5), (2.5, -1.0, 2.0), (2.5, 1.0, 2.0)]
    ),
}
"""Layouts by name: the paper's square, one of 4 m, eight on a circle of 3 m diameter, a square
overhead, a wall."""


def parse_layout(text: str) -> Beacons:
    """Return the set that one line of text describes: a preset's name or `id x y z; …` in m.

    Raises MeasurementError, DegenerateGeometryError.
    """
    name = text.strip()
    if len(name) > LONGEST:
        raise MeasurementError(
            f"layout of {len(name)} characters; allowed are {LONGEST}: round its positions"
        )
    if name in PRESETS:
        return PRESETS[name]
    parts = [part for part in name.replace("\n", ";").split(";") if part.strip()]
    if len(parts) <= 1 and not any(letter.isdigit() for letter in name):
        hint = did_you_mean(name, PRESETS) or "write x y z in m"
        raise MeasurementError(
            f"layout {_shown(name)} is neither a preset ({', '.join(PRESETS)}) "
            f"nor 'id x y z; …' of at least 4 beacons: {hint}"
        )
    rows = [_beacon(number, part) for number, part in enumerate(parts, start=1)]
    return Beacons([id for id, *_ in rows], [place for _, *place in rows])


def format_layout(beacons: Beacons) -> str:
    """Return the line from which `parse_layout` makes the same set; a preset's name if it is
    one.
    """
    for name, preset in PRESETS.items():
        if beacons == preset:
            return name
    return "; ".join(
        f"{id} {x!r} {y!r} {z!r}"
        for id, (x, y, z) in zip(beacons.ids.tolist(), beacons.positions_w.tolist(), strict=True)
    )


def _beacon(number: int, part: str) -> tuple[int, float, float, float]:
    """Return one `id x y z`; commas are accepted as separators too."""
    words = part.replace(",", " ").split()
    try:
        id, x, y, z = words
        return int(id), float(x), float(y), float(z)
    except ValueError:
        raise MeasurementError(
            f"beacon {number} of the layout is {_shown(part.strip())}; allowed is 'id x y z', "
            "a whole number and three numbers in m, like '1 1.0 -1.0 0.1'"
        ) from None


def _shown(text: str) -> str:
    """Shorten the text as it is written: an escaped character takes up to ten."""
    shown = repr(text)
    return shown if len(shown) <= _SHOWN else f"{shown[:_SHOWN]}…{shown[0]}"
