"""What a set of gains does at a given rate of poses.

The filter's own discretisation is stable at any rate, but a pole that is fast for the rate makes
it repeat the noise of each pose, and the gains as printed (gain times period at arrival)
diverge: both are said before a flight.
"""

from __future__ import annotations

import math

from estimation.attitude_filter import attitude_gains
from estimation.parameters import EstimationParameters
from estimation.translation_observer import translation_gains

FOLLOWS_NOISE = 0.9
"""Share of an innovation taken at once above which the filter repeats the measurement."""


def gain_warnings(parameters: EstimationParameters, rate: float) -> list[str]:
    """One line for each thing wrong at `rate` poses a second (Hz); empty when nothing is.

    A rate of 0 or less, or not finite, means that no pose comes.
    """
    if not math.isfinite(rate) or rate <= 0.0:
        return ["no pose comes: position and velocity are only predicted"]
    interval = 1.0 / rate
    out: list[str] = []
    p = parameters
    position, velocity, _ = translation_gains(
        p.position_bandwidth, p.accelerometer_bias_bandwidth, interval
    )
    if position > FOLLOWS_NOISE:
        out.append(
            f"position_bandwidth {p.position_bandwidth:g} rad/s follows the noise of each pose at "
            f"{rate:g} Hz ({velocity:.3g} m/s of velocity per m of noise); "
            f"stay below {_highest_bandwidth(0.5, rate):.3g} rad/s"
        )
    attitude, _ = attitude_gains(p.attitude_bandwidth, p.gyroscope_bias_bandwidth, interval)
    if attitude > FOLLOWS_NOISE:
        out.append(
            f"attitude_bandwidth {p.attitude_bandwidth:g} rad/s follows the noise of each pose at "
            f"{rate:g} Hz; stay below {_highest_bandwidth(1.0, rate):.3g} rad/s"
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
    """The pole (rad/s) at which 1 - exp(-omega T / multiple) reaches FOLLOWS_NOISE."""
    return -math.log(1.0 - FOLLOWS_NOISE) * multiple * rate
