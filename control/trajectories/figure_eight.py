"""The 8 of Sec. 7: laps at a constant phase rate between smooth ramps.

x = w/2 sin(phase), y = h/2 sin(2 phase), z and yaw = amplitude sin(phase) about a centre where it
starts and ends at rest. Departs from print, which gives no time law: rest to rest in one lap of 8 s
would need 37° of tilt, a constant rate only 8°.
"""

from __future__ import annotations

import math

import numpy as np

from control.trajectories.laps import check_ramp, lap_rates, lap_stretches
from control.trajectories.ramped_phase import Derivatives, ramped_phase
from control.trajectories.trajectory import Stretch
from quadrotor.compiled import compiled, direct
from quadrotor.records import Item, Record, new_reference

FIGURE_EIGHT = np.dtype(
    [
        ("center", "f8", 4),  # m, m, m, rad
        ("amplitude", "f8", 4),  # m, m, m, rad
        ("rate", "f8"),  # rad/s of the phase
        ("ramp", "f8"),  # s
        ("total", "f8"),  # rad
    ],
    align=True,
)


@compiled(inner=True)
def circling(s: float, c: float, a: float, b: float, d: float, e: float) -> Derivatives:
    """Return the sine of an angle and its four time derivatives, by Faa di Bruno's formula.

    Args:
        s, c: its sine and cosine; for the cosine's derivatives pass c and -s.
        a, b, d, e: the angle's time derivatives, first to fourth.
    """
    aa = a * a
    return (
        s,
        c * a,
        c * b - s * aa,
        c * (d - aa * a) - 3.0 * s * a * b,
        c * (e - 6.0 * aa * b) - s * (4.0 * a * d + 3.0 * b * b - aa * aa),
    )


@compiled(inner=True)
def figure_eight_at(eight: Item, t: float, reference: Item) -> None:
    """Write the reference at t (s) on one FIGURE_EIGHT record into one REFERENCE record.

    One sine and one cosine are computed: those of twice the phase follow from them.
    """
    q, a, b, d, e = ramped_phase(t, eight.rate, eight.ramp, eight.total)
    s = math.sin(q)
    c = math.cos(q)
    one = circling(s, c, a, b, d, e)
    two = circling(2.0 * s * c, c * c - s * s, 2.0 * a, 2.0 * b, 2.0 * d, 2.0 * e)
    for i in range(3):
        k = eight.amplitude[i]
        p, v, acceleration, j, snap = two if i == 1 else one
        reference.position_w[i] = eight.center[i] + k * p
        reference.velocity_w[i] = k * v
        reference.acceleration_w[i] = k * acceleration
        reference.jerk_w[i] = k * j
        reference.snap_w[i] = k * snap
    k = eight.amplitude[3]
    reference.yaw = eight.center[3] + k * one[0]
    reference.yaw_rate = k * one[1]
    reference.yaw_acceleration = k * one[2]


@compiled
def sample_figure_eight(eights: Record, t: float, references: Record, step: float = 0.0) -> None:
    """Write references[k] at t + k step (s) on eights[k], or on the last one; shapes (M,), (N,)."""
    for k in range(references.shape[0]):
        figure_eight_at(eights[min(k, eights.shape[0] - 1)], t + k * step, references[k])


class FigureEight:
    """Laps of the 8; C4 in position and yaw, at rest in `center` before and after.

    Args:
        center: (x, y, z) m.
        yaw: rad, the middle of the yaw's swing.
        width, height: m, the bounding box in x and y.
        z_amplitude: m.
        yaw_amplitude: rad.
        period: s per lap at the constant rate.
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
        check_ramp(laps, period, ramp)
        self._eight = np.zeros(1, FIGURE_EIGHT)
        rate, total = lap_rates(laps, period)
        swing = (0.5 * width, 0.5 * height, z_amplitude, yaw_amplitude)
        self._eight[0] = ((*center, yaw), swing, rate, ramp, total)
        self._sample = direct(sample_figure_eight, self._eight, 0.0, new_reference(), 0.0)
        self._stretches = lap_stretches(laps, period, ramp)
        self.duration = laps * period + ramp

    @classmethod
    def in_one_lap(
        cls,
        center: tuple[float, float, float],
        yaw: float = 0.0,
        *,
        duration: float = 8.0,
        **shape: float,
    ) -> FigureEight:
        """Return a figure 8 from rest to rest in one lap of `duration` s.

        It is a ramp up to the middle and a ramp down from it.

        Args:
            shape: width, height, z_amplitude and yaw_amplitude, as for the class.
        """
        return cls(center, yaw, period=0.5 * duration, laps=1, ramp=0.5 * duration, **shape)

    def sample(self, t: float, reference: Record) -> None:
        self._sample(self._eight, t, reference, 0.0)

    def sample_grid(self, t: float, step: float, references: Record) -> None:
        sample_figure_eight(self._eight, t, references, step)

    def stretches(self) -> tuple[Stretch, ...]:
        return self._stretches
