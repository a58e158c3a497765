"""Quantities of coplanar beacons that are constant over all frames: plane, axes, basis."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from quadrotor.errors import DegenerateGeometryError, MeasurementError
from quadrotor.records import Array

Four = tuple[int, int, int, int]

FLATNESS = 1e-3
"""Largest distance of a beacon from the common plane, as a share of the extent."""
IN_LINE = 1e-3
"""Share of the extent within which beacons count as lying on one line."""


@dataclass(frozen=True, eq=False, slots=True)
class BeaconPlane:
    """The plane of N >= 4 beacons.

    Attributes:
        beacons_w: (N, 3) m.
        center_w: (3,) m, their mean.
        axes: (3, 3) rows e1, e2 in the plane and e3 = e1 x e2, its normal; world axes.
        extent: m, rms distance along e1: it scales the plane coordinates to order one.
        four: indices of the four whose homography starts the search.
        homography: (4, 6) of those four, as used by `homography.homography_pose`.
        spanned: False when three of the four are on one line: they have no homography.
    """

    beacons_w: Array
    center_w: Array
    axes: Array
    extent: float
    four: Four
    homography: Array
    spanned: bool

    @classmethod
    def of(cls, beacons_w: npt.ArrayLike, ids: Sequence[int] | None = None) -> BeaconPlane:
        """Return the plane of beacons.

        Args:
            beacons_w: (N, 3) m, N >= 4.
            ids: of the beacons, to check that none occurs twice.

        Raises MeasurementError when malformed, DegenerateGeometryError when there are fewer than
        four, one occurs twice, all are on one line, or they are not in one plane.
        """
        beacons = _checked(beacons_w, ids)
        center: Array = beacons.mean(axis=0)
        _, singular, axes = np.linalg.svd(beacons - center, full_matrices=False)
        extent = float(singular[0]) / math.sqrt(len(beacons))
        if not (singular[1] > IN_LINE * singular[0] and extent > 1e-6):
            raise DegenerateGeometryError(
                f"{len(beacons)} beacons lie on one line or at one point; "
                "four that span a plane are needed: move one aside"
            )
        if singular[2] > FLATNESS * singular[0]:
            off = float(np.abs((beacons - center) @ axes[2]).max())
            raise DegenerateGeometryError(
                f"beacons leave their common plane by up to {off:.3g} m; "
                f"allowed {FLATNESS * extent:.2g} m: level them or correct their positions"
            )
        axes[2] = np.cross(axes[0], axes[1])
        plane = (beacons - center) @ axes[:2].T / extent
        four, homography, spanned = _homography(plane, axes, extent, None)
        return cls(beacons, center, axes, extent, four, homography, spanned=spanned)

    def others(self) -> list[BeaconPlane]:
        """Return the same beacons with other fours that span a plane: each without one
        of `four`.
        """
        plane = (self.beacons_w - self.center_w) @ self.axes[:2].T / self.extent
        found = []
        for left_out in self.four if len(plane) > 4 else ():
            four, homography, spanned = _homography(plane, self.axes, self.extent, left_out)
            if spanned:
                found.append(replace(self, four=four, homography=homography))
        return found


def _homography(
    plane: Array, axes: Array, extent: float, left_out: int | None
) -> tuple[Four, Array, bool]:
    """Return `four`, `homography` and `spanned` of a plane, from its coordinates (N, 2)."""
    kept = np.array([k for k in range(len(plane)) if k != left_out])
    among, spread = _widest_four(plane[kept])
    i, j, k, m = (int(kept[one]) for one in among)
    homography = np.zeros((4, 6))
    homography[:3, 3:], homography[3, 3] = axes, extent
    if spread > IN_LINE:
        a = np.column_stack([plane[[i, j, k, m]], np.ones(4)]).T
        shares = np.linalg.solve(a[:, :3], a[:, 3])
        homography[:3, :3] = np.linalg.inv(a[:, :3]) / shares[:, None]
        homography[3, :3] = 1.0 / shares
    return (i, j, k, m), homography, spread > IN_LINE


def _widest_four(plane: Array) -> tuple[Four, float]:
    """Return four of the points (N, 2), no three of them near a line, and the area of their
    smallest triangle.

    They are the farthest from the middle, the farthest from that one, the one that forms the
    largest triangle with both, and the one whose smallest triangle with those is largest.
    """
    order = np.lexsort(np.round(plane, 9).T)  # the same four in any order of the beacons
    points = plane[order]
    i = int(np.argmax((points**2).sum(axis=1)))
    j = int(np.argmax(((points - points[i]) ** 2).sum(axis=1)))
    k = int(np.argmax(_areas(points, i, j)))
    least = np.minimum(_areas(points, i, j), np.minimum(_areas(points, j, k), _areas(points, k, i)))
    m = int(np.argmax(least))
    first, second, third, fourth = (int(order[n]) for n in (i, j, k, m))
    return (first, second, third, fourth), float(min(least[m], _areas(points, i, j)[k]))


def _areas(points: Array, i: int, j: int) -> Array:
    """Return the areas of the triangles of points i, j and each point, shape (N,)."""
    u, v = points[j] - points[i], points - points[i]
    areas: Array = 0.5 * np.abs(u[0] * v[:, 1] - u[1] * v[:, 0])
    return areas


def _checked(beacons_w: npt.ArrayLike, ids: Sequence[int] | None) -> Array:
    try:
        beacons = np.array(beacons_w, dtype=float, order="C")
    except (TypeError, ValueError) as error:
        raise MeasurementError("beacons are not an (N, 3) array of numbers") from error
    if beacons.ndim != 2 or beacons.shape[1] != 3:
        raise MeasurementError(f"beacons of shape {beacons.shape}; (N, 3) is needed, m")
    if ids is not None:
        if len(ids) != len(beacons):
            raise MeasurementError(
                f"{len(ids)} ids for {len(beacons)} beacons; each beacon needs its own"
            )
        require_distinct(ids)
    if len(beacons) < 4:
        raise DegenerateGeometryError(
            f"{len(beacons)} bearings received; a planar pose needs at least 4: "
            "bring more beacons into view"
        )
    if not np.isfinite(beacons).all():
        raise MeasurementError("a beacon's position is not finite; check the beacons' list")
    return beacons


def require_distinct(ids: Sequence[int]) -> None:
    """Raise DegenerateGeometryError when a beacon's id occurs more than once."""
    if len(set(ids)) < len(ids):
        twice = sorted(one for one, times in Counter(ids).items() if times > 1)
        raise DegenerateGeometryError(
            f"beacon {', '.join(map(str, twice))} appears more than once in one frame; "
            "each may be seen once: check the identities"
        )
