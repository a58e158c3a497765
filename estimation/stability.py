"""The stability of a set of gains at a given rate of poses.

The filter's own discretisation is stable at any rate, but a pole that is too fast for the rate
makes it repeat the noise of each pose, and the gains as printed, multiplied by the period at
arrival, diverge. Both are reported, before and during a flight.
"""

from __future__ import annotations

import math

from estimation.attitude_filter import attitude_gains
from estimation.gains import ContinuousGains, continuous_gains
from estimation.parameters import EstimationParameters
from estimation.translation_observer import translation_gains

FOLLOWS_NOISE = 0.9
"""Share of an innovation applied at once above which the filter repeats the measurement."""


def printed_radius(gains: ContinuousGains, rate: float) -> float:
    """Return the spectral radius over one period when gains as printed are multiplied by the period
    T.

    The error (position, velocity) is multiplied by F = [[1, T], [0, 1]] between measurements and by
    I - T [K_p; K_v] [1, 0] at each; the attitude's by 1 - K_q T. Above 1 the filter diverges.
    """
    return max(_translation_radius(gains, rate), abs(1.0 - gains.K_q / rate))


def lowest_stable_rate(gains: ContinuousGains) -> float:
    """Return the rate (Hz) below which `printed_radius` exceeds 1, by bisection."""
    low, high = 1e-3, 1e6
    while high > (1.0 + 1e-9) * low:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if printed_radius(gains, middle) <= 1.0 else (middle, high)
    return high


def _translation_radius(gains: ContinuousGains, rate: float) -> float:
    # Trace and determinant of the product above, [[1 - a, (1 - a) T], [-c, 1 - c T]].
    a, c_T = gains.K_p / rate, gains.K_v / (rate * rate)
    half, product = 0.5 * (2.0 - a - c_T), 1.0 - a
    square = half * half - product
    if square < 0.0:  # a complex pair
        return math.sqrt(product)
    return abs(half) + math.sqrt(square)


def gain_warnings(parameters: EstimationParameters, rate: float) -> list[str]:
    """Return one line for each problem at `rate` poses a second (Hz); empty when there is none.

    A rate of 0 or less, or not finite, means that no poses arrive.
    """
    if not math.isfinite(rate) or rate <= 0.0:
        return ["no pose comes: position and velocity are only predicted"]
    interval = 1.0 / rate
    out: list[str] = []
    p = parameters
    position, velocity, _ = translation_gains(
        p.position_bandwidth, p.accelerometer_bias_bandwidth, interval
    )
    printed = continuous_gains(p)
    radius = _translation_radius(printed, rate)
    if position > FOLLOWS_NOISE or radius > 1.0:
        least = lowest_stable_rate(ContinuousGains(printed.K_p, printed.K_v, 0.0))
        most = min(_highest_bandwidth(0.5, rate), p.position_bandwidth * rate / least)
        out.append(
            f"position_bandwidth {p.position_bandwidth:g} rad/s follows the noise of each pose at "
            f"{rate:.3g} Hz ({velocity:.3g} m/s of velocity per m of noise)"
            f"{_diverges(radius, least)}; "
            f"stay below {most:.3g} rad/s"
        )
    attitude, _ = attitude_gains(p.attitude_bandwidth, p.gyroscope_bias_bandwidth, interval)
    radius = abs(1.0 - printed.K_q * interval)
    if attitude > FOLLOWS_NOISE or radius > 1.0:
        out.append(
            f"attitude_bandwidth {p.attitude_bandwidth:g} rad/s follows the noise of each pose at "
            f"{rate:.3g} Hz{_diverges(radius, 0.5 * printed.K_q)}; "
            f"stay below {min(_highest_bandwidth(1.0, rate), 2.0 * rate):.3g} rad/s"
        )
    for name, bias, pole in (
        ("accelerometer", p.accelerometer_bias_bandwidth, p.position_bandwidth),
        ("gyroscope", p.gyroscope_bias_bandwidth, p.attitude_bandwidth),
    ):
        if bias > 0.5 * pole:
            out.append(
                f"{name}_bias_bandwidth {bias:g} rad/s is too near the pole of {pole:g} rad/s it "
                f"works through; stay below {0.5 * pole:.3g} rad/s"
            )
    if 1.5 * interval > p.measurement_timeout:
        out.append(
            f"measurement_timeout {p.measurement_timeout:g} s declares the pose lost between "
            f"poses at {rate:g} Hz; allow at least {1.5 * interval:.3g} s"
        )
    return out


def _highest_bandwidth(multiple: float, rate: float) -> float:
    """Return the pole (rad/s) at which 1 - exp(-omega T / multiple) reaches FOLLOWS_NOISE."""
    return -math.log(1.0 - FOLLOWS_NOISE) * multiple * rate


def _diverges(radius: float, least: float) -> str:
    if radius <= 1.0:
        return ""
    return (
        f" and, taken as printed, diverges (spectral radius {radius:.2f}; "
        f"stable above {least:.3g} Hz)"
    )
