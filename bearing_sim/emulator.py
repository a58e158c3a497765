"""Emulated bearings to beacons from a pose (paper, Secs. 6.2 and 7), as a camera would give them.

"1.5 deg STD" is read as independent N(0, 1.5°) along each of two tangent axes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bearing_sim.beacons import PAPER_BEACONS, Beacons
from bearing_sim.quaternions import Array, Triple, rows_of
from bearing_sim.sampling import SECOND_NS, DelayLine, SampleGrid
from quadrotor.parameters import Parameters, parameter

NEAREST = 0.01
"""m; a beacon nearer than this to the camera has no direction."""

SIGMA_TOLD_MIN = 0.01
"""deg; an estimator cannot weigh measurements that claim to be exact."""


class BearingParameters(Parameters):
    """The bearing sensor that is not on the vehicle."""

    rate: float = parameter(30.0, unit="Hz", ge=1, le=200, step=1, description="frames a second")
    sigma: float = parameter(
        1.5, unit="deg", ge=0, le=20, step=0.1, description="noise on each of two tangent axes"
    )
    range_max: float = parameter(
        20.0, unit="m", ge=0.1, le=100, step=0.1, description="beacons farther away are not seen"
    )
    field_of_view: float = parameter(
        360.0, unit="deg", ge=10, le=360, step=5, description="full angle about the body's -z axis"
    )
    drop_out: float = parameter(
        0.0, ge=0, le=1, step=0.01, description="share of single bearings lost"
    )
    swap: float = parameter(
        0.0, ge=0, le=1, step=0.01, description="share of frames with two identities exchanged"
    )
    delay: float = parameter(
        0.0, unit="s", ge=0, le=0.5, step=0.001, description="from the frame to its arrival"
    )
    seed: int = parameter(2, ge=0, le=2**31 - 1, step=1, description="of the noise")


class BearingMeasurement(NamedTuple):
    """One frame: stamp (ns), ids (n,), unit vectors (n, 3) in body axes, sigma in rad."""

    stamp_ns: int
    beacon_ids: npt.NDArray[np.int32]
    bearings_b: Array
    sigma: float


class BearingEmulator:
    """Feed poses with `observe`, take frames with `due`; a frame may hold no bearing at all.

    `parameters` may be changed between calls; a new seed restarts the noise.
    """

    def __init__(self, parameters: BearingParameters, beacons: Beacons = PAPER_BEACONS) -> None:
        self.parameters = parameters
        self.beacons = beacons
        self._seed: int | None = None
        self._random = np.random.default_rng()
        self._grid = SampleGrid()
        self._line: DelayLine[BearingMeasurement] = DelayLine()

    def observe(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        """The pose at `stamp_ns`: (3,) m, (4,) unit quaternion body to world."""
        p = self.parameters
        if not self._grid.takes(stamp_ns, p.rate):
            return
        if p.seed != self._seed:
            self._seed, self._random = p.seed, np.random.default_rng(p.seed)
        beacons = self.beacons
        count = len(beacons.ids)
        # All drawn in each frame, so that what is seen does not shift the noise.
        noise = self._random.standard_normal((count, 2)).tolist()
        kept = self._random.random(count).tolist()
        swapped = self._random.random() < p.swap
        exchanged = self._random.permutation(count)[:2].tolist()

        ids = beacons.ids.tolist()
        if swapped:
            one, other = exchanged
            ids[one], ids[other] = ids[other], ids[one]
        sigma = math.radians(p.sigma)
        lowest = math.cos(math.radians(0.5 * p.field_of_view)) if p.field_of_view < 360.0 else -2.0
        x, y, z = position_w.tolist()
        (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = rows_of(quaternion_wb)
        seen_ids, seen = [], []
        # Plain floats: on four beacons, numpy's calls cost more than the arithmetic.
        for id, place_w, share, (along, across) in zip(
            ids, beacons.positions_w.tolist(), kept, noise, strict=True
        ):
            u, v, w = place_w[0] - x, place_w[1] - y, place_w[2] - z
            distance = math.sqrt(u * u + v * v + w * w)
            if share < p.drop_out or not NEAREST < distance <= p.range_max:
                continue
            bearing_b = (
                (r00 * u + r10 * v + r20 * w) / distance,
                (r01 * u + r11 * v + r21 * w) / distance,
                (r02 * u + r12 * v + r22 * w) / distance,
            )
            if -bearing_b[2] >= lowest:
                seen_ids.append(id)
                seen.append(perturbed(bearing_b, sigma * along, sigma * across))
        frame = BearingMeasurement(
            stamp_ns,
            np.array(seen_ids, np.int32),
            np.array(seen, np.float64).reshape(-1, 3),
            math.radians(max(p.sigma, SIGMA_TOLD_MIN)),
        )
        self._line.put(stamp_ns + round(p.delay * SECOND_NS), frame)

    def due(self, now_ns: int) -> list[BearingMeasurement]:
        """What has arrived by `now_ns`, each given once, in order."""
        return self._line.due(now_ns)

    @property
    def next_ns(self) -> int | None:
        """When the next frame under way arrives, None when there is none."""
        return self._line.next_ns


def perturbed(bearing: Triple, along: float, across: float) -> Triple:
    """A unit vector moved on the sphere by two angles (rad), along two tangent axes."""
    x, y, z = bearing
    # Two tangents without a square root, well conditioned everywhere (Duff et al., JCGT 2017).
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    angle = math.sqrt(along * along + across * across)
    share = math.sin(angle) / max(angle, 1e-300)
    cosine, along, across = math.cos(angle), share * along, share * across
    return (
        cosine * x + along * (1.0 + sign * x * x * a) + across * b,
        cosine * y + along * sign * b + across * (sign + y * y * a),
        cosine * z - along * sign * x - across * y,
    )
