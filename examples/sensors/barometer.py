"""A sensor: the height above the place of take-off, by the board's barometer.

Copy it to the folder `plugins` of the data folder (`quadlab new sensor NAME` does that), and choose
it with `--set estimation.estimator=error_state estimation.sensors=barometer`. It runs in a separate
process; each reading is compared with the estimate, and one too far from it is refused.
"""

from __future__ import annotations

import math

from quadrotor.parameters import Parameters, parameter
from vehicle.sensors.contract import Array, Input, Reading

PASCALS_PER_METRE = 11.6
"""In the lowest few hundred metres of the standard atmosphere."""


class Options(Parameters):
    """Parameters of the vehicle as `plugins.barometer.noise`: sliders on the Gains tab, `--set`."""

    noise: float = parameter(0.3, unit="m", ge=0.05, le=5.0, step=0.05)
    """standard deviation of a reading, its slow drift included"""


class Barometer:
    """Sensor; the vehicle makes one instance and calls `step` in each tick."""

    def __init__(self) -> None:
        self.parameters = Options()

    def reset(self, x: Input) -> None:
        """Begin: the pressure at height 0 is not known yet."""
        self._zero = math.nan  # Pa
        self._last = math.nan  # Pa

    def step(self, x: Input) -> Reading | None:
        """Return a height (m), once in flight and when there is a new pressure."""
        if not x.flying:
            zero = x.pressure + PASCALS_PER_METRE * x.position_w[2]
            self._zero = zero if math.isnan(self._zero) else 0.99 * self._zero + 0.01 * zero
        is_new, self._last = x.pressure != self._last, x.pressure
        height = (self._zero - x.pressure) / PASCALS_PER_METRE
        if not (x.flying and is_new and math.isfinite(height)):
            return None
        return Reading(height, expected_height, self.parameters.noise)


def expected_height(position_w: Array, quaternion_wb: Array) -> float:
    """Return what it would measure there, m."""
    return float(position_w[2])


sensor = Barometer  # the name that the vehicle imports
PROTOCOL = 1  # of what it imports: docs/extending/plugins.md
