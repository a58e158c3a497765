"""Emulated bearings from one vehicle to the others, as a camera on it would give them."""

from __future__ import annotations

import math

import numpy as np

from bearing_sim.bearing_parameters import BearingParameters
from bearing_sim.emulator import BearingEmulator
from console.experiments.together import Company, Neighbour
from quadrotor.plain_rotations import Triple

STILL = 0.1
"""Age, s, of the last meeting above which a vehicle does not meet any more."""


class RelativeBearings(BearingEmulator):
    """The bearing sensor of `bearing_sim`, whose beacons are the other vehicles, numbered from 1.

    All its parameters apply, but `layout`: rate, noise, range, field of view, mount, spells of
    occlusion, drop-outs, swapped identities, biases, delay and faults.

    Args:
        occlusion: whether a vehicle hides those behind it: a sphere as large as its rotors.
    """

    def __init__(self, parameters: BearingParameters, company: Company, occlusion: bool) -> None:
        super().__init__(parameters)
        self._company, self._occlusion = company, occlusion
        others = [k for k in range(len(company.names)) if k != company.index]
        self._others = others

    def look(self) -> None:
        """Observe all vehicles as they were at the last meeting."""
        own = self._company.neighbour(self._company.index)
        self.observe(own.stamp_ns, np.array(own.position_w), np.array(own.quaternion_wb))

    def _places(self, stamp_ns: int, position_w: Triple) -> list[tuple[int, Triple]]:
        places = {k: _place(self._company.neighbour(k), stamp_ns) for k in self._others}
        return [
            (k + 1, place)
            for k, place in places.items()
            if not (self._occlusion and self._is_hidden(k, places, position_w))
        ]

    def _is_hidden(self, k: int, places: dict[int, Triple], from_w: Triple) -> bool:
        """Return whether the line to vehicle k passes through another one nearer than it."""
        ray = [b - a for a, b in zip(from_w, places[k], strict=True)]
        distance = math.sqrt(sum(one * one for one in ray))
        for other, place in places.items():
            to = [b - a for a, b in zip(from_w, place, strict=True)]
            along = sum(a * b for a, b in zip(ray, to, strict=True)) / max(distance, 1e-9)
            if other == k or not 0.0 < along < distance:
                continue
            beside = math.sqrt(max(0.0, sum(one * one for one in to) - along * along))
            if (
                beside < 0.5 * self._company.neighbour(other).radius
            ):  # the frame; one looks through the rotors
                return True
        return False


def _place(other: Neighbour, stamp_ns: int) -> Triple:
    """Return where it was; the last place of a vehicle that has landed and meets us no more."""
    since = 1e-9 * (stamp_ns - other.stamp_ns)
    if abs(since) > STILL:
        return other.position_w
    (x, y, z), (u, v, w) = other.position_w, other.velocity_w
    return x + since * u, y + since * v, z + since * w
