"""The distance of a gain set from oscillation: phase margins of the loops about hover.

Linear model of one axis about hover, with the motors' first-order lag (time constant tau), which
the laws neglect (Sec. 5.3). Sideways, with g theta the acceleration a tilt gives,

    position gains  P(s) = k_p + k_v s + k_i / s      (eq. 4, per unit mass)
    attitude gains  A(s) = k_R + k_f / s              (eq. 5, per unit inertia)
    feed-forward    F(s) = A(s) from the nominal force, A(s) + k_w s + s^2 from the exact one
    tilt            theta = F theta_d / ((tau s + 1) s^2 + A + k_w s)
    position loop   L = P F / (s^2 ((tau s + 1) s^2 + A + k_w s))

broken at the desired tilt; the same closed loop broken at the motors is what a slower motor or a
delay there meets. Height and yaw are one loop each.

A disturbance observer (control.disturbance_observer) of low pass Q = a / (s + a) has the model's
motors G = 1 / (tau s + 1) next to the true ones. Broken there, L becomes (L + Q G) / (1 - Q G): the
torque's at the motors and in yaw, the force's in height. Sideways it holds the measured motion
against the measured tilt, neither of which is behind the desired tilt or the motors: those two
cuts do not see it. The loop `estimate` does, broken at the measured motion x. With d the force
subtracted, whose two derivatives are fed forward behind low passes W = b / (s + b) and W V, with V
= c / (s + c),

    B theta = -M x - O d,    d = Q (s^2 x - theta),    L = (M + O Q s^2) / (s^2 (B - O Q))

    M = P A                                 B = (tau s + 1) s^2 + A + k_w s
    O = A + k_w s W + s^2 W V                                     with the nominal rates
    M + k_w (k_p s + k_i) + k_i s           B + k_w k_v + k_p + k_v s
    O + k_w k_v + k_p + k_v s W                                   with the exact ones

because the exact rates take acceleration and jerk from attitude and angular velocity, which are
not late with the motion. Without an observer and with the nominal rates it is L of the position
loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from control.disturbance_observer import CURVE_POLE, RATE_POLE
from control.parameters import ControlParameters

Complex = npt.NDArray[np.complex128]
Real = npt.NDArray[np.float64]
Polynomial = np.polynomial.Polynomial

FREQUENCIES = np.logspace(-2.0, 3.0, 400)
"""Frequencies, in rad/s, between which crossovers are searched."""
LOW_MARGIN = 20.0
"""Phase margin, in deg, below which a gain set is not fit to fly."""


@dataclass(frozen=True, slots=True)
class Margin:
    """The stability margin of one loop.

    Attributes:
        loop: name of the loop.
        phase: deg, the smallest over all crossovers; negative when the loop is unstable.
        crossover: rad/s, frequency of unit gain with that phase.
    """

    loop: str
    phase: float
    crossover: float

    @property
    def delay(self) -> float:
        """Return the additional delay (s) that the loop tolerates; 0 when it is unstable."""
        return max(0.0, math.radians(self.phase) / self.crossover)


def margins(parameters: ControlParameters, motor_time_constant: float) -> tuple[Margin, ...]:
    """Return the margins of the position, motor, height, yaw and estimate loops of these gains.

    Args:
        motor_time_constant: s, > 0.
    """
    p, a, d = parameters.position, parameters.attitude, parameters.disturbance
    lag = Polynomial([1.0, motor_time_constant])
    s = Polynomial([0.0, 1.0])
    # All multiplied by s, so that integral gains are coefficients too.
    position = Polynomial([p.ki_xy, p.kp_xy, p.kv_xy])
    attitude = Polynomial([a.ki_xy, a.kr_xy])
    damped = Polynomial([a.ki_xy, a.kr_xy, a.kw_xy])
    feed_forward = damped + s**3 if a.rates == "exact" else attitude
    tilt = lag * s**3 + damped
    height = Polynomial([p.ki_z, p.kp_z, p.kv_z])
    yaw = Polynomial([a.ki_z, a.kr_z, a.kw_z])
    force = d.force_bandwidth if d.force else 0.0
    torque = d.torque_bandwidth if d.torque else 0.0
    motors = damped * s**3 + position * feed_forward
    return (
        _margin("position", position * feed_forward, s**3 * tilt),
        _margin("motors", *_observed(motors, lag * s**6, torque, lag)),
        _margin("height", *_observed(height, lag * s**3, force, lag)),
        _margin("yaw", *_observed(yaw, lag * s**3, torque, lag)),
        _margin("estimate", *_estimate(parameters, lag, force)),
    )


def _estimate(
    parameters: ControlParameters, lag: Polynomial, force: float
) -> tuple[Polynomial, Polynomial]:
    """Return the loop broken at the measured motion; `force` is the observer's bandwidth (rad/s), 0
    for none.
    """
    p, a = parameters.position, parameters.attitude
    s = Polynomial([0.0, 1.0])
    rate, curve = Polynomial([RATE_POLE, 1.0]), Polynomial([CURVE_POLE, 1.0])
    integral = Polynomial([a.ki_xy, a.kr_xy])
    motion = integral * Polynomial([p.ki_xy, p.kp_xy, p.kv_xy])  # s^2 M
    tilt = lag * s**3 + integral + a.kw_xy * s**2  # s B
    # s O, times (s + b) (s + c): angle, rate and angular acceleration of the force's direction.
    taken = (integral * rate + RATE_POLE * a.kw_xy * s**2) * curve + RATE_POLE * CURVE_POLE * s**3
    if a.rates == "exact":
        motion += a.kw_xy * s**2 * Polynomial([p.ki_xy, p.kp_xy]) + p.ki_xy * s**3
        tilt += s * Polynomial([a.kw_xy * p.kv_xy + p.kp_xy, p.kv_xy])
        taken += (s * (a.kw_xy * p.kv_xy + p.kp_xy) * rate + RATE_POLE * p.kv_xy * s**2) * curve
    if force == 0.0:
        return motion, s**3 * tilt
    left = rate * curve * Polynomial([force, 1.0])
    return motion * left + force * taken * s**3, s**3 * (tilt * left - force * taken)


def _observed(
    above: Polynomial, below: Polynomial, bandwidth: float, lag: Polynomial
) -> tuple[Polynomial, Polynomial]:
    """Return the loop above / below with an observer of this bandwidth (rad/s); 0 for none."""
    if bandwidth == 0.0:
        return above, below
    low_pass = Polynomial([bandwidth, 1.0]) * lag
    return above * low_pass + bandwidth * below, below * (low_pass - bandwidth)


def smallest(found: tuple[Margin, ...]) -> Margin:
    """Return the loop that is nearest to oscillation."""
    return min(found, key=lambda one: one.phase)


def _margin(loop: str, above: Polynomial, below: Polynomial) -> Margin:
    """Return the margin of the loop above / below.

    It is stable when above + below has no root with a positive real part.
    """

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
        closed, below = closed[1:], Polynomial(below.coef[1:])
    stable = bool(np.polynomial.Polynomial(closed).roots().real.max() < 0.0)
    return Margin(loop, abs(worst) if stable else -abs(worst), where)
