"""Emulated bearings to beacons from a pose (paper, Secs. 6.2 and 7), as a camera would give them.

"1.5 deg STD" is read as independent N(0, 1.5°) along each of two tangent axes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bearing_sim.beacons import PAPER_BEACONS, Beacons
from bearing_sim.quaternions import Array, matrix_of
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
        count = len(self.beacons.ids)
        # All drawn in each frame, so that what is seen does not shift the noise.
        noise = np.radians(p.sigma) * self._random.standard_normal((count, 2))
        kept = self._random.random(count) >= p.drop_out
        swapped = self._random.random() < p.swap
        exchanged = self._random.permutation(count)[:2]

        offsets_b = (self.beacons.positions_w - position_w) @ matrix_of(quaternion_wb)
        distances = np.sqrt(np.sum(offsets_b**2, axis=1))
        bearings_b = offsets_b / np.maximum(distances, NEAREST)[:, None]
        seen = kept & (distances <= p.range_max) & (distances > NEAREST)
        if p.field_of_view < 360.0:
            seen &= -bearings_b[:, 2] >= np.cos(np.radians(0.5 * p.field_of_view))
        ids = self.beacons.ids.copy()
        if swapped:
            ids[exchanged] = ids[exchanged[::-1]]
        frame = BearingMeasurement(
            stamp_ns,
            ids[seen],
            perturbed(bearings_b[seen], noise[seen]),
            float(np.radians(max(p.sigma, SIGMA_TOLD_MIN))),
        )
        self._line.put(stamp_ns + round(p.delay * SECOND_NS), frame)

    def due(self, now_ns: int) -> list[BearingMeasurement]:
        """What has arrived by `now_ns`, each given once, in order."""
        return self._line.due(now_ns)

    @property
    def next_ns(self) -> int | None:
        """When the next frame under way arrives, None when there is none."""
        return self._line.next_ns


def perturbed(bearings: Array, angles: Array) -> Array:
    """Unit vectors (N, 3) moved on the sphere by `angles` (N, 2), rad, along two tangent axes."""
    x, y, z = bearings.T
    # Two tangents without a square root, well conditioned everywhere (Duff et al., JCGT 2017).
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    along, across = angles[:, 0], angles[:, 1]
    step = np.empty_like(bearings)
    step[:, 0] = along * (1.0 + sign * x * x * a) + across * b
    step[:, 1] = along * sign * b + across * (sign + y * y * a)
    step[:, 2] = -along * sign * x - across * y
    angle = np.sqrt(along * along + across * across)
    share = np.sin(angle) / np.maximum(angle, 1e-300)
    return np.asarray(np.cos(angle)[:, None] * bearings + share[:, None] * step)
