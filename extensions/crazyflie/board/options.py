"""The options of a Crazyflie, and what its parameters are set to at each start."""

from __future__ import annotations

import math

from pydantic import Field

from quadrotor.errors import OutOfBoundsError
from quadrotor.parameters import Parameters, parameter


class CrazyflieOptions(Parameters):
    """Configuration of one Crazyflie."""

    thrust_max: float = parameter(0.48, unit="N", ge=0.1, le=4.0, step=0.01)
    """thrust of all four motors at its largest set-point, 65535; 0.72 with the thrust upgrade kit,
    0.8 for the Brushless"""
    landing_thrust: float = parameter(0.3, unit="N", ge=0.05, le=4.0, step=0.01)
    """thrust of the level descent when the flight stack gives up, a little under the weight"""
    landing_time: float = parameter(8.0, unit="s", ge=1.0, le=30.0, step=0.5)
    """this descent ends after this, motors off"""
    pose_rate: float = parameter(50.0, unit="Hz", ge=0.0, le=100.0, step=5.0)
    """poses a second that its own estimator is given; 0: none"""
    parameters: str = parameter("stabilizer.controller=1; stabilizer.estimator=2")
    """parameters of its firmware that are set at each start, and when this changes,
    GROUP.NAME=VALUE; ...: PID and Kalman filter. Each one is shown as board.firmware.GROUP.NAME, as
    are those named without a value: pid_rate.roll_kp, or pid_rate.* for a group"""
    firmware: Parameters = Field(default_factory=Parameters)
    """the named parameters of its firmware, once these have been read"""

    def check_together(self) -> None:
        """Check that `parameters` can be read. Raises OutOfBoundsError."""
        _ = self.named

    @property
    def named(self) -> dict[str, float | None]:
        """Return {name or pattern: value, None without one} of `parameters`.

        Raises OutOfBoundsError.
        """
        found: dict[str, float | None] = {}
        for word in filter(None, map(str.strip, self.parameters.split(";"))):
            name, equals, number = map(str.strip, word.partition("="))
            value = _number(number) if equals else None
            if not all(name.partition(".")) or not math.isfinite(value or 0.0):
                raise OutOfBoundsError(
                    f"board.parameters has {word!r}; give GROUP.NAME=VALUE; ... with numbers, like "
                    "stabilizer.controller=1, or GROUP.NAME or GROUP.* without one"
                )
            found[name] = value
        return found

    @property
    def wanted(self) -> dict[str, float]:
        """Return {name: value} of the `parameters` that have a value. Raises OutOfBoundsError."""
        return {name: value for name, value in self.named.items() if value is not None}


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
