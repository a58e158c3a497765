"""Faults of the emulated bearing sensor and of its beacons."""

from __future__ import annotations

import math

from bearing_sim.beacon_set import ID_MAX
from bearing_sim.faults.fault import Catalogue, Fault, Memory
from bearing_sim.faults.schedule import Moment
from bearing_sim.sampling import SECOND_NS, Draws, pair
from quadrotor.parameters import parameter
from quadrotor.plain_rotations import Triple, quaternion_of, rotate

Places = list[tuple[int, Triple]]
"""Beacons in the room: id and position (m, world axes)."""


class BearingFault(Fault):
    """Base of the bearings' faults, each of which changes one of three things."""

    def moves(self, places: Places, moment: Moment) -> Places:
        """Return where the beacons really are."""
        return places

    def names(self, ids: list[int], moment: Moment) -> list[int]:
        """Return the ids that are reported, in the order of the beacons."""
        return ids

    def bends(
        self, bearing_b: Triple, axis_b: Triple, draws: Draws, moment: Moment, memory: Memory
    ) -> Triple:
        """Return the bearing of a beacon, (3,) unit, as it is measured.

        Args:
            axis_b: the sensor's axis.
            draws: random numbers of this beacon in this frame.
            memory: of this beacon in this spell; `frame_ns` is the stamp of the frame.
        """
        return bearing_b


class MovingBeacon(BearingFault):
    """A beacon moves at a constant speed, and its stated place stays."""

    name = "bearings.moving_beacon"
    source = "definition"
    of = ("id",)
    varies = True

    id: int = parameter(1, ge=0, le=ID_MAX, step=1)
    """beacon that moves"""
    x: float = parameter(0.1, unit="m/s", ge=-5, le=5, step=0.05)
    """speed along x_W"""
    y: float = parameter(0.0, unit="m/s", ge=-5, le=5, step=0.05)
    """speed along y_W"""
    z: float = parameter(0.0, unit="m/s", ge=-5, le=5, step=0.05)
    """speed along z_W"""

    def moves(self, places: Places, moment: Moment) -> Places:
        way = moment.level * moment.elapsed
        return [
            (id, (x + way * self.x, y + way * self.y, z + way * self.z) if id == self.id else place)
            for id, place in places
            for x, y, z in (place,)
        ]


class SwappedIdentities(BearingFault):
    """Two beacons are reported under each other's identity, for as long as the fault is on."""

    name = "bearings.swapped_identities"
    source = "LEDs or tags read wrongly; definition"

    first: int = parameter(1, ge=0, le=ID_MAX, step=1)
    """one of the two beacons"""
    second: int = parameter(2, ge=0, le=ID_MAX, step=1)
    """the other one"""

    def names(self, ids: list[int], moment: Moment) -> list[int]:
        other = {self.first: self.second, self.second: self.first}
        return [other.get(id, id) for id in ids]


class CorrelatedNoise(BearingFault):
    """Each beacon's bearing wanders: noise that is correlated from frame to frame."""

    name = "bearings.correlated_noise"
    source = "first-order Gauss-Markov process: A. Gelb, Applied Optimal Estimation, 1974, 2.2"
    varies = True

    sigma: float = parameter(1.0, unit="°", ge=0, le=20, step=0.1)
    """standard deviation on each of two axes of the turn"""
    time: float = parameter(2.0, unit="s", ge=0.01, le=100, step=0.1)
    """correlation time"""

    def bends(
        self, bearing_b: Triple, axis_b: Triple, draws: Draws, moment: Moment, memory: Memory
    ) -> Triple:
        a, b = pair(draws, math.inf)
        c, _ = pair(draws, math.inf)
        fresh = (a, b, c)
        since = (memory["frame_ns"] - memory.get("wander_ns", memory["frame_ns"])) / SECOND_NS
        fade = math.exp(-since / self.time)
        draw = math.sqrt(1.0 - fade * fade)
        before = memory.get("wander")
        found = [n if before is None else fade * before[k] + draw * n for k, n in enumerate(fresh)]
        memory["wander"], memory["wander_ns"] = found, memory["frame_ns"]
        angle = moment.level * math.radians(self.sigma)
        x, y, z = rotate(quaternion_of(*(angle * one for one in found)), bearing_b)
        return x, y, z


class Lens(BearingFault):
    """The lens distorts: the angle from the sensor's axis grows with its own cube."""

    name = "bearings.lens"
    source = (
        "radial distortion of first order: D. C. Brown, Decentering distortion of lenses, 1966, "
        "in the angle, as of an equidistant lens"
    )

    k: float = parameter(0.05, unit="1/rad²", ge=-0.3, le=0.3, step=0.01)
    """read angle = angle (1 + k angle²)"""

    def bends(
        self, bearing_b: Triple, axis_b: Triple, draws: Draws, moment: Moment, memory: Memory
    ) -> Triple:
        (ax, ay, az), (bx, by, bz) = axis_b, bearing_b
        along = max(-1.0, min(1.0, ax * bx + ay * by + az * bz))
        x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        across = math.sqrt(x * x + y * y + z * z)
        if across < 1e-9:
            return bearing_b
        angle = math.atan2(across, along)
        turn = moment.level * self.k * angle**3 / across
        x, y, z = rotate(quaternion_of(turn * x, turn * y, turn * z), bearing_b)
        return x, y, z


BEARINGS: tuple[type[BearingFault], ...] = (
    *(MovingBeacon, SwappedIdentities, CorrelatedNoise, Lens),
)
CATALOGUE = Catalogue("bearings.faults", {one.name: one for one in BEARINGS})
