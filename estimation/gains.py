"""The forms of the gains of eqs. 11 and 12, and the conversions between them.

- continuous, as printed: K_p (1/s), K_v (1/s^2), K_q (1/s) on the innovation;
- poles (rad/s), as in EstimationParameters: K_p = 2 omega, K_v = omega^2, K_q = omega_q;

Bias poles are given as poles in both, because the paper has none; here they are zero by default.
What the filter applies at each arrival follows from the poles (translation_observer,
attitude_filter).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.parameters import EstimationParameters
from quadrotor.errors import OutOfBoundsError

DAMPING_TOLERANCE = 0.01
"""Largest relative deviation of K_v from that of a double pole."""


@dataclass(frozen=True, slots=True)
class ContinuousGains:
    """K_est,p stacked [K_p; K_v] of eq. 11 and K_est,q of eq. 12."""

    K_p: float  # 1/s
    K_v: float  # 1/s^2
    K_q: float  # 1/s


PRINTED = ContinuousGains(K_p=126.3, K_v=3987.3, K_q=62.8)
"""The gains of Sec. 6.1."""


def continuous_gains(parameters: EstimationParameters) -> ContinuousGains:
    """Return the continuous gains of these poles, without the biases."""
    omega = parameters.position_bandwidth
    return ContinuousGains(2.0 * omega, omega * omega, parameters.attitude_bandwidth)


def from_continuous(gains: ContinuousGains, **others: float) -> EstimationParameters:
    """Return the parameters for gains as printed.

    Args:
        others: further fields, for instance bias poles.

    Raises OutOfBoundsError when K_p, K_v are not those of a double pole, the only one that the
    filter has, or a pole is out of its bounds.
    """
    omega = 0.5 * gains.K_p
    if not abs(gains.K_v - omega * omega) <= DAMPING_TOLERANCE * omega * omega:
        raise OutOfBoundsError(
            f"K_p = {gains.K_p:g} 1/s and K_v = {gains.K_v:g} 1/s² are no double pole; "
            f"with this K_p the filter has K_v = {omega * omega:g} 1/s²"
        )
    return _parameters(math.sqrt(gains.K_v), gains.K_q, others)


def _parameters(omega: float, omega_q: float, others: dict[str, float]) -> EstimationParameters:
    values = {
        "accelerometer_bias_bandwidth": 0.0,
        "gyroscope_bias_bandwidth": 0.0,
        "position_bandwidth": omega,
        "attitude_bandwidth": omega_q,
    } | others
    try:
        return EstimationParameters.model_validate(values)
    except ValueError as error:
        first = str(error).splitlines()
        raise OutOfBoundsError(f"these gains are out of bounds: {' '.join(first[1:3])}") from error
