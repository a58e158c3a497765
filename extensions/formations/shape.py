"""The desired formation: bearings between vehicles, checked to be one that can be flown."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

from extensions.formations.mathematics.realisation import realise
from extensions.formations.mathematics.rigidity import (
    bearings,
    is_rigid,
    missing_edges,
    rigidity_eigenvalue,
)
from quadrotor.errors import DegenerateGeometryError, UsageError
from quadrotor.records import Array

AGREEMENT = math.radians(0.5)
"""Residual (rms) up to which desired bearings agree."""
FACING = "facing"
"""Name of a formation whose vehicles see enough of each other in a field of view of 90 deg: of
random ones that keep 1.35 m apart, the one with the greatest rigidity eigenvalue."""
FACING_PLACES = np.array(
    [
        [1.83, 0.21, -0.29],
        [-1.02, 0.06, 0.36],
        [-1.52, -1.13, -0.24],
        [0.02, 1.15, -0.16],
        [0.69, -0.29, 0.33],
    ]
)
FACING_YAWS = np.radians([-174.0, -9.0, 42.0, -89.0, 141.0])
Edge = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Shape:
    """A formation.

    Attributes:
        places: (n, 3), at unit mean distance, centroid at the origin. yaws: (n,) rad.
        desired: bearing (3,) by edge, observer and observed, in the observer's yaw frame.
    """

    places: Array
    yaws: Array
    desired: dict[Edge, Array]

    @cached_property
    def distances(self) -> list[list[float]]:
        """Return the distances of all pairs of vehicles, in mean distances."""
        return [
            [float(np.linalg.norm(there - here)) for there in self.places] for here in self.places
        ]

    def eigenvalue(self, edges: frozenset[Edge], vehicles: frozenset[int]) -> float:
        """Return the rigidity eigenvalue of some vehicles at the desired places."""
        return _eigenvalue(self, edges, vehicles)

    def missing(self, edges: frozenset[Edge], vehicles: frozenset[int]) -> list[Edge]:
        """Return edges that would make these vehicles rigid. Raises DegenerateGeometryError."""
        number = sorted(vehicles)
        found = missing_edges(*self._part(edges, number))
        return [(number[i], number[j]) for i, j in found]

    def _part(
        self, edges: frozenset[Edge], number: list[int]
    ) -> tuple[Array, Array, npt.NDArray[np.intp]]:
        inner = [(number.index(i), number.index(j)) for i, j in sorted(edges)]
        pairs = np.array(inner, np.intp).reshape(-1, 2)
        return self.places[number], self.yaws[number], pairs


@lru_cache(maxsize=512)
def _eigenvalue(shape: Shape, edges: frozenset[Edge], vehicles: frozenset[int]) -> float:
    if len(vehicles) < 2:
        return 0.0
    return rigidity_eigenvalue(*shape._part(edges, sorted(vehicles)))


def pyramid(count: int) -> Array:
    """Return places (n, 3) on a regular polygon, and one over its middle, in radii."""
    around = count - 1 if count > 3 else count
    angles = 2.0 * math.pi * np.arange(around) / around
    places = np.zeros((count, 3))
    places[:around, 0], places[:around, 1] = np.cos(angles), np.sin(angles)
    places[around:, 2] = 0.4
    places[0, 2] = -0.2  # not in one plane
    return places


def shape_of(text: str, count: int) -> Shape:
    """Return the shape of `FormationOptions.desired`. Raises UsageError."""
    try:
        if text.strip() in ("", FACING):
            places, yaws = pyramid(count), np.zeros(count)
            if text.strip():
                if count != len(FACING_PLACES):
                    raise UsageError(
                        f"experiment.desired=facing is of {len(FACING_PLACES)} vehicles, not of "
                        f"{count}: fly so many, or give the bearings"
                    )
                places, yaws = FACING_PLACES, FACING_YAWS
            every = [(i, j) for i in range(count) for j in range(count) if i != j]
            return _shape(places, yaws, every, bearings(places, yaws, every))
        edges, wanted = _parsed(text, count)
        places, yaws, residual = realise(wanted, edges, count)
        if residual > AGREEMENT:
            off = np.linalg.norm(bearings(places, yaws, edges) - wanted, axis=1)
            k = int(off.argmax())
            raise UsageError(
                f"experiment.desired: the bearings contradict each other by "
                f"{math.degrees(residual):.1f}° rms; worst is {_named((edges[k],))}, by "
                f"{math.degrees(float(off[k])):.0f}°: leave it out, or correct it"
            )
        if not is_rigid(places, yaws, edges):
            lacking = missing_edges(places, yaws, edges)
            raise UsageError(
                f"experiment.desired: the formation is not rigid; it lacks {_named(lacking)}"
            )
        return _shape(places, yaws, edges, wanted)
    except DegenerateGeometryError as error:
        raise UsageError(f"experiment.desired: {error}") from None


def _shape(places: Array, yaws: Array, edges: list[Edge], wanted: Array) -> Shape:
    away = places - places.mean(axis=0)
    i, j = np.triu_indices(len(away), 1)
    away = away / np.linalg.norm(away[i] - away[j], axis=1).mean()
    return Shape(away, yaws, dict(zip(edges, wanted, strict=True)))


def _parsed(text: str, count: int) -> tuple[list[Edge], Array]:
    edges: list[Edge] = []
    wanted: list[tuple[float, float, float]] = []
    for part in (one.strip() for one in text.rstrip("; ").split(";")):
        words = part.split()
        try:
            observer, observed = (int(word) - 1 for word in words[:2])
            azimuth, elevation = (math.radians(float(word)) for word in words[2:])
            flat, up = math.cos(elevation), math.sin(elevation)
            bearing = flat * math.cos(azimuth), flat * math.sin(azimuth), up
        except ValueError:
            bearing = math.nan, math.nan, math.nan
        if math.isnan(sum(bearing)):
            raise UsageError(
                f"experiment.desired: {part!r:.60} is no bearing; write 'observer observed azimuth "
                "elevation; …', like '1 2 90 0', in deg"
            )
        if observer == observed or (observer, observed) in edges:
            why = "is of a vehicle to itself" if observer == observed else "is given already"
            raise UsageError(f"experiment.desired: {part!r:.60} {why}; leave it out")
        for vehicle in (observer, observed):
            if not 0 <= vehicle < count:
                raise UsageError(
                    f"experiment.desired: {part!r:.60} is about vehicle {vehicle + 1}; there are "
                    f"1 to {count}"
                )
        wanted.append(bearing)
        edges.append((observer, observed))
    return edges, np.array(wanted)


def _named(edges: tuple[Edge, ...]) -> str:
    return ", ".join(f"quad{i + 1} to quad{j + 1}" for i, j in edges)
