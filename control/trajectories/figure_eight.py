"""The 8 of Sec. 7: laps at a constant phase rate between smooth ramps.

x = w/2 sin(phase), y = h/2 sin(2 phase), z and yaw = amplitude sin(phase) about a centre where
it starts and ends at rest. Departs from print, which gives no time law: rest to rest in one
lap of 8 s would ask for 37° of tilt, a constant rate for 8°.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from control.trajectories.ramped_phase import ramped_phase
from quadrotor.compiled import compiled
from quadrotor.records import Record

Array = npt.NDArray[np.float64]

FIGURE_EIGHT = np.dtype(
    [
        ("center", "f8", 4),  # m, m, m, rad
        ("amplitude", "f8", 4),  # m, m, m, rad
        ("multiple", "f8", 4),  # cycles a lap
        ("rate", "f8"),  # rad/s of the phase
        ("ramp", "f8"),  # s
        ("total", "f8"),  # rad
    ],
    align=True,
)


@compiled
def _sine(multiple: float, phase: Array, out: Array) -> None:
    """sin(multiple phase(t)) and four time derivatives into out (5,), by Faà di Bruno."""
    s = math.sin(multiple * phase[0])
    c = math.cos(multiple * phase[0])
    a = multiple * phase[1]
    b = multiple * phase[2]
    d = multiple * phase[3]
    e = multiple * phase[4]
    out[0] = s
    out[1] = c * a
    out[2] = c * b - s * a * a
    out[3] = c * (d - a * a * a) - 3.0 * s * a * b
    out[4] = c * (e - 6.0 * a * a * b) - s * (4.0 * a * d + 3.0 * b * b - a * a * a * a)


@compiled
def sample_figure_eight(eight: Record, t: float, reference: Record) -> None:
    """The reference at t (s) on eight[0], into reference[0]; both shape (1,)."""
    a = eight[0]
    r = reference[0]
    phase = np.empty(5)
    s = np.empty(5)
    ramped_phase(t, a.rate, a.ramp, a.total, phase)
    for i in range(4):
        _sine(a.multiple[i], phase, s)
        d = a.amplitude[i]
        if i < 3:
            r.position_w[i] = a.center[i] + d * s[0]
            r.velocity_w[i] = d * s[1]
            r.acceleration_w[i] = d * s[2]
            r.jerk_w[i] = d * s[3]
            r.snap_w[i] = d * s[4]
        else:
            r.yaw = a.center[i] + d * s[0]
            r.yaw_rate = d * s[1]
            r.yaw_acceleration = d * s[2]


class FigureEight:
    """Laps of the 8; C4 in position and yaw, at rest in `center` before and after.

    Args:
        center: (x, y, z) m.
        yaw: rad, the middle of the yaw's swing.
        width, height: m, the bounding box in x and y.
        z_amplitude: m. yaw_amplitude: rad.
        period: s a lap at the constant rate.
        laps: whole laps of phase; the ramps are within the first and the last.
        ramp: s of each ramp, at most laps * period.

    Raises ValueError for a ramp that does not fit.
    """

    def __init__(
        self,
        center: tuple[float, float, float],
        yaw: float = 0.0,
        *,
        width: float = 1.0,
        height: float = 1.0,
        z_amplitude: float = 0.2,
        yaw_amplitude: float = 1.0,
        period: float = 8.0,
        laps: int = 3,
        ramp: float = 3.0,
    ) -> None:
        if not 0.0 < ramp <= laps * period:
            raise ValueError(
                f"a ramp of {ramp:g} s does not fit into {laps} laps of {period:g} s: "
                f"give one up to {laps * period:g} s"
            )
        self._eight = np.zeros(1, FIGURE_EIGHT)
        self._eight["center"] = (*center, yaw)
        self._eight["amplitude"] = (0.5 * width, 0.5 * height, z_amplitude, yaw_amplitude)
        self._eight["multiple"] = (1.0, 2.0, 1.0, 1.0)
        self._eight["rate"] = 2.0 * math.pi / period
        self._eight["ramp"] = ramp
        self._eight["total"] = 2.0 * math.pi * laps
        self.duration = laps * period + ramp

    def sample(self, t: float, reference: Record) -> None:
        sample_figure_eight(self._eight, t, reference)
