"""The forms of the gains of eqs. 11 and 12, and the conversion from one to the other.

- continuous, as printed: K_p (1/s), K_v (1/s^2), K_q (1/s) on the innovation;
- poles (rad/s), as in EstimationParameters: K_p = 2 omega, K_v = omega^2, K_q = omega_q;

Bias poles are given as poles in both, because the paper has none; here they are zero by default.
What the filter applies at each arrival follows from the poles (translation_observer,
attitude_filter).
"""

from __future__ import annotations

from dataclasses import dataclass

from estimation.parameters import EstimationParameters


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
