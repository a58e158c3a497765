"""A measured pose, as a tracking system sends it."""

from __future__ import annotations

from typing import NamedTuple

from quadrotor.plain_rotations import Array


class PoseMeasurement(NamedTuple):
    """One pose: when it was valid (ns), position (3,) m, quaternion (4,) (w, x, y, z), or
    NO_ATTITUDE for a single marker.
    """

    stamp_ns: int
    position_w: Array
    quaternion_wb: Array
