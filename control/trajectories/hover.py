"""A trajectory that holds one position."""

from __future__ import annotations

import numpy as np

from control.trajectories.phase_curve import PHASE_CURVE, sample_phase_curve
from quadrotor.records import Record


class Hover:
    """A fixed point and yaw without end: a line of zero length.

    Args:
        position_w: (x, y, z) m.
        yaw: rad.
    """

    def __init__(self, position_w: tuple[float, float, float], yaw: float) -> None:
        self._line = np.zeros(1, PHASE_CURVE)
        self._line["center"] = (*position_w, yaw)
        self._line["rate"] = 1.0
        self._line["ramp"] = 1.0
        self._line["total"] = 1.0
        self.duration = float("inf")

    def sample(self, t: float, reference: Record) -> None:
        sample_phase_curve(self._line, t, reference, 0.0)
