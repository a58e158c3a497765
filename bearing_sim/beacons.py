"""Beacons with known identity and position in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class Beacons:
    """N beacons: `ids` shape (N,), `positions_w` shape (N, 3) in m, world axes."""

    ids: npt.NDArray[np.int32]
    positions_w: npt.NDArray[np.float64]


PAPER_BEACONS = Beacons(
    ids=np.array([1, 2, 3, 4], dtype=np.int32),
    positions_w=np.array([[1.0, 1.0, 0.1], [-1.0, 1.0, 0.1], [-1.0, -1.0, 0.1], [1.0, -1.0, 0.1]]),
)
"""The paper's Sec. 7: 4 beacons 10 cm above the ground on a square of 2 m."""
