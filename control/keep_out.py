"""Keep-out boxes: axis-aligned boxes of the world frame that no reference comes near.

    none
    pillar 0.5 1.0 -0.2 0.3 0.0 2.5; net -3.0 3.0 2.0 2.2 0.0 3.0

The second form is a name and x, y and z from and to of each box, m in world axes, separated by
semicolons. A margin (m) keeps the whole vehicle out: a box grown by it on all sides is what the
vehicle's centre must not enter.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from quadrotor.errors import OutOfBoundsError, RefusedError

PARAMETER, NONE = "behavior.keep_out", "none"
MOST = 8
"""Largest number of boxes, each of which costs time in every tick."""
COLUMN = 1.0
"""Height, in m, above a vehicle on the ground that a new box must leave free for its take-off."""
FARTHEST = 100.0
"""Largest absolute value of a coordinate, in m."""
EXAMPLE = "give 'name x_min x_max y_min y_max z_min z_max; …' in m, or none"
AROUND = "fly around it, or move or remove the box (behavior.keep_out, behavior.keep_out_margin)"
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,19}")
_ROUNDING = 1e-6  # m
_SHOWN = 60  # characters of a wrong text that its error message repeats

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class KeepOutBox:
    """A box, by its lowest and its highest corner, m in world axes."""

    name: str
    low_w: Vector
    high_w: Vector

    def gap(self, point_w: Sequence[float]) -> float:
        """Return by how much (m) the box would have to grow to reach a point; negative inside."""
        sides = zip(self.low_w, point_w, self.high_w, strict=True)
        return max(max(low - c, c - high) for low, c, high in sides)

    def __str__(self) -> str:
        ranges = zip(self.low_w, self.high_w, strict=True)
        return " ".join([self.name, *(f"{low!r} {high!r}" for low, high in ranges)])


KeepOut = tuple[KeepOutBox, ...]


@dataclass(frozen=True, slots=True)
class Encounter:
    """The first place where a path comes too near to a box.

    Attributes:
        at: index into the points of the path, with the fraction of the way to the next one.
        margin: m, that this box's neighbourhood has.
    """

    box: KeepOutBox
    at: float
    place_w: Vector
    margin: float

    def __str__(self) -> str:
        x, y, z = (round(c, 2) + 0.0 for c in self.place_w)  # no -0.00
        return (
            f"within {self.margin:.2f} m of the keep-out box {self.box.name} "
            f"at ({x:.2f}, {y:.2f}, {z:.2f}) m"
        )


@lru_cache(maxsize=64)
def parse_keep_out(text: str) -> KeepOut:
    """Return the boxes that one line of text describes. Raises OutOfBoundsError."""
    if text.strip() in ("", NONE):
        return ()
    boxes = tuple(_box(part) for part in text.split(";") if part.strip())
    if len(boxes) > MOST:
        raise OutOfBoundsError(f"{PARAMETER}: {len(boxes)} boxes; allowed {MOST}: join neighbours")
    names = [box.name for box in boxes]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise OutOfBoundsError(f"{PARAMETER}: two boxes are called {twice}; give each its own name")
    return boxes


def format_keep_out(boxes: Sequence[KeepOutBox]) -> str:
    """Return the line from which `parse_keep_out` makes the same boxes."""
    return "; ".join(map(str, boxes)) or NONE


def first_encounter(
    boxes: KeepOut, points_w: npt.ArrayLike, margin: float, *, may_leave: bool = False
) -> Encounter | None:
    """Return where the polyline through points (N, 3) first comes nearer than `margin` to a box.

    Args:
        may_leave: whether a path that starts nearer may lead away, or past at its first distance.
    """
    points = np.asarray(points_w, np.float64)
    if len(points) == 1:
        points = np.repeat(points, 2, axis=0)
    found: list[Encounter] = []
    for box in boxes:
        kept = min(margin, box.gap(points[0].tolist())) if may_leave else margin
        a, along = points[:-1], np.diff(points, axis=0)
        # Where each segment enters and leaves the slab between two faces, as a share of its length.
        with np.errstate(divide="ignore", invalid="ignore"):
            one = (np.array(box.low_w) - kept + _ROUNDING - a) / along
            other = (np.array(box.high_w) + kept - _ROUNDING - a) / along
        enters = np.fmin(one, other).max(axis=1).clip(min=0.0)
        inside = enters < np.fmax(one, other).min(axis=1).clip(max=1.0)
        if inside.any():
            k = int(inside.argmax())
            x, y, z = (a[k] + enters[k] * along[k]).tolist()
            found.append(Encounter(box, k + float(enters[k]), (x, y, z), margin))
    return min(found, key=lambda one: one.at, default=None)


def check_around(
    boxes: KeepOut, margin: float, before: KeepOut, margin_before: float, way_w: npt.ArrayLike
) -> None:
    """Check that a change brings no box nearer than `margin` (m) to where the vehicle is.

    Args:
        before, margin_before: what is replaced: the vehicle may have been too near already.
        way_w: (N, 3), where the vehicle flies, or on the ground up to where it takes off to.

    Raises RefusedError that names the box.
    """
    for box in boxes:
        met = first_encounter((box,), way_w, margin)
        if met is None or (box in before and first_encounter((box,), way_w, margin_before)):
            continue
        x, y, z = np.asarray(way_w, np.float64)[0].tolist()
        place = f"the vehicle at ({x:.2f}, {y:.2f}, {z:.2f}) m"
        if box.gap((x, y, z)) < margin:
            what = f"{place} is inside the keep-out box {box.name} with its {margin:.2f} m"
        else:
            what = f"the keep-out box {box.name} with its {margin:.2f} m is above {place}"
        raise RefusedError(f"{PARAMETER} refused: {what}; move the vehicle away or the box's face")


def _box(part: str) -> KeepOutBox:
    words = part.replace(",", " ").split()
    shown = f"{PARAMETER}: {part.strip()[:_SHOWN]!r}"
    try:
        name, *six = words
        x0, x1, y0, y1, z0, z1 = map(float, six)
    except ValueError:
        raise OutOfBoundsError(f"{shown} is not a name with six numbers; {EXAMPLE}") from None
    if not _NAME.fullmatch(name):
        raise OutOfBoundsError(f"{shown} does not begin with a name, like pillar_1; {EXAMPLE}")
    for axis, low, high in (("x", x0, x1), ("y", y0, y1), ("z", z0, z1)):
        # Written so that a NaN is refused.
        if not (abs(low) <= FARTHEST and abs(high) <= FARTHEST):
            raise OutOfBoundsError(
                f"{shown}: {axis} from {low:g} to {high:g} m; allowed ±{FARTHEST:g} m"
            )
        if not low < high:
            raise OutOfBoundsError(
                f"{shown}: {axis} from {low:g} to {high:g} m; the first must be below the second"
            )
    return KeepOutBox(name, (x0, y0, z0), (x1, y1, z1))
