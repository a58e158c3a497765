"""How far a gain set is from oscillating: phase margins of the loops about hover.

Linear model of one axis about hover, with the motors' first-order lag (time constant tau), which
the laws neglect (Sec. 5.3). Sideways, with g theta the acceleration a tilt gives,

    position gains  P(s) = k_p + k_v s + k_i / s      (eq. 4, per unit mass)
    attitude gains  A(s) = k_R + k_f / s              (eq. 5, per unit inertia)
    feed-forward    F(s) = A(s) from the nominal force, A(s) + k_w s + s^2 from the exact one
    tilt            theta = F theta_d / ((tau s + 1) s^2 + A + k_w s)
    position loop   L = P F / (s^2 ((tau s + 1) s^2 + A + k_w s))

broken at the desired tilt; the same closed loop broken at the motors is what a slower motor or a
delay there meets. Height and yaw are one loop each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from control.parameters import ControlParameters

Complex = npt.NDArray[np.complex128]
Real = npt.NDArray[np.float64]

FREQUENCIES = np.logspace(-2.0, 3.0, 400)
"""rad/s, between which crossovers are sought."""
LOW_MARGIN = 20.0
"""deg of phase margin below which a gain set is not fit to fly."""


@dataclass(frozen=True, slots=True)
class Margin:
    """Of one loop.

    Attributes:
        loop: its name.
        phase: deg, the smallest over all crossovers; negative when the loop is unstable.
        crossover: rad/s, where the gain passes 1 with that phase.
    """

    loop: str
    phase: float
    crossover: float

    @property
    def delay(self) -> float:
        """s of further delay the loop bears; 0 when it is unstable."""
        return max(0.0, math.radians(self.phase) / self.crossover)


def margins(parameters: ControlParameters, motor_time_constant: float) -> tuple[Margin, ...]:
    """Margins of the position, motor, height and yaw loops of these gains.

    Args:
        motor_time_constant: s, > 0.
    """
    p, a = parameters.position, parameters.attitude
    lag = np.polynomial.Polynomial([1.0, motor_time_constant])
    s = np.polynomial.Polynomial([0.0, 1.0])
    # All times s, so that integral gains are coefficients too.
    position = np.polynomial.Polynomial([p.ki_xy, p.kp_xy, p.kv_xy])
    attitude = np.polynomial.Polynomial([a.ki_xy, a.kr_xy])
    damped = np.polynomial.Polynomial([a.ki_xy, a.kr_xy, a.kw_xy])
    feed_forward = damped + s**3 if a.rates == "exact" else attitude
    tilt = lag * s**3 + damped
    height = np.polynomial.Polynomial([p.ki_z, p.kp_z, p.kv_z])
    yaw = np.polynomial.Polynomial([a.ki_z, a.kr_z, a.kw_z])
    return (
        _margin("position", position * feed_forward, s**3 * tilt),
        _margin("motors", damped * s**3 + position * feed_forward, lag * s**6),
        _margin("height", height, lag * s**3),
        _margin("yaw", yaw, lag * s**3),
    )


def smallest(found: tuple[Margin, ...]) -> Margin:
    """The loop nearest to oscillating."""
    return min(found, key=lambda one: one.phase)


def _margin(loop: str, above: np.polynomial.Polynomial, below: np.polynomial.Polynomial) -> Margin:
    """Of the loop above / below; its closed loop is stable when above + below has no root right."""

    def response(frequency: Real) -> Complex:
        s = 1j * frequency
        out: Complex = np.asarray(above(s) / below(s), dtype=complex)
        return out

    gain = np.abs(response(FREQUENCIES)) - 1.0
    worst, where = math.inf, math.inf
    for k in np.flatnonzero(gain[:-1] * gain[1:] <= 0.0):
        low, high = FREQUENCIES[k], FREQUENCIES[k + 1]
        share = gain[k] / (gain[k] - gain[k + 1])
        crossover = np.array([low * (high / low) ** share])
        phase = math.degrees(float(np.angle(-response(crossover))[0]))
        if abs(phase) < abs(worst):
            worst, where = phase, float(crossover[0])
    closed = (above + below).coef
    while closed[0] == 0.0 and below.coef[0] == 0.0:  # no integral gain: s cancels
        closed, below = closed[1:], np.polynomial.Polynomial(below.coef[1:])
    stable = bool(np.polynomial.Polynomial(closed).roots().real.max() < 0.0)
    return Margin(loop, abs(worst) if stable else -abs(worst), where)
