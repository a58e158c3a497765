"""Laps of a circle, level or rising: constant phase rate between smooth ramps.

The yaw of a nose along the tangent or towards the centre is the phase plus a constant, so it has as
many derivatives as the phase.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from control.trajectories.laps import check_ramp, lap_rates, lap_stretches
from control.trajectories.phase_curve import PHASE_CURVE, sample_phase_curve
from control.trajectories.trajectory import Stretch
from quadrotor.records import Record

Nose = Literal["fixed", "tangent", "center"]
Side = Literal["left", "right"]


class Circle:
    """Laps that start and end at rest in `start`; C4 in position and yaw.

    Args:
        start: (x, y, z, yaw) m and rad, on the circle.
        radius: m, > 0.
        nose: "fixed" keeps the yaw; "tangent" flies nose first, the centre abeam; "center" points
            at the centre, which is straight ahead.
        side: "left" flies counter-clockwise seen from above, "right" clockwise. With a fixed nose
            or along the tangent, the centre lies on that side of the start's yaw.
        rise: m per lap; 0 is a level circle.
        period, laps, ramp: s, whole laps, s: as for `figure_eight.FigureEight`.

    Raises ValueError for a ramp that does not fit.
    """

    def __init__(
        self,
        start: tuple[float, float, float, float],
        *,
        radius: float = 1.0,
        nose: Nose = "fixed",
        side: Side = "left",
        rise: float = 0.0,
        period: float = 8.0,
        laps: int = 3,
        ramp: float = 3.0,
    ) -> None:
        check_ramp(laps, period, ramp)
        x, y, z, yaw = start
        turn = 1.0 if side == "left" else -1.0
        bearing = yaw if nose == "center" else yaw + turn * 0.5 * math.pi  # of the centre
        ahead = (radius * math.cos(bearing), radius * math.sin(bearing))
        rate, total = lap_rates(laps, period)
        self._curve = np.zeros(1, PHASE_CURVE)
        self._curve[0] = (
            (x + ahead[0], y + ahead[1], z, yaw),
            (-ahead[0], -ahead[1], 0.0),
            (turn * ahead[1], -turn * ahead[0], 0.0),
            (0.0, 0.0, rise / (2.0 * math.pi), 0.0 if nose == "fixed" else turn),
            rate,
            ramp,
            total,
        )
        self._stretches = lap_stretches(laps, period, ramp)
        self.duration = laps * period + ramp

    def sample(self, t: float, reference: Record) -> None:
        sample_phase_curve(self._curve, t, reference, 0.0)

    def sample_grid(self, t: float, step: float, references: Record) -> None:
        sample_phase_curve(self._curve, t, references, step)

    def stretches(self) -> tuple[Stretch, ...]:
        return self._stretches
