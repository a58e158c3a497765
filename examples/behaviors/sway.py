"""A behavior: sway to the left and back three times, or further while the sticks ask for it.

Copy it to the folder `plugins` of the data folder (`quadlab new behavior NAME` does that), choose
it with `--set behavior.plugin=sway`, and start the behavior `external`. It runs in a separate
process; the vehicle checks each reference, and brakes when one cannot be flown or none comes.
"""

from __future__ import annotations

import numpy as np

from quadrotor.parameters import Parameters, parameter
from vehicle.behaviors.contract import Answer, Input

TIMES = 3
FASTER = 0.5  # of the period, with the stick full forward


class Options(Parameters):
    """Parameters of the vehicle as `plugins.sway.width`: sliders on the Gains tab, `--set`, log."""

    width: float = parameter(0.5, unit="m", ge=0.1, le=2.0, step=0.1)
    """of the sway; taken at its beginning"""
    period: float = parameter(4.0, unit="s", ge=2.0, le=10.0, step=0.5)
    """of one sway; taken at once"""


class Sway:
    """Behavior; the vehicle makes one instance and calls `step` in each tick."""

    def __init__(self) -> None:
        self.parameters = Options()

    def reset(self, x: Input) -> None:
        """Begin at the reference that is flown now."""
        self._start_w, self._yaw = x.reference_position_w.copy(), x.reference_yaw
        self._width = self.parameters.width
        self._phase = 0.0  # rad

    def step(self, x: Input) -> Answer | None:
        """Return the reference at `x.time`; None when the behavior is over."""
        rate = 2.0 * np.pi / self.parameters.period * (1.0 + FASTER * x.stick[0])
        self._phase += rate * x.dt
        if self._phase >= 2.0 * np.pi * TIMES:
            return None
        # y = width (1 - cos phase) / 2, and its derivatives up to snap
        turn = -0.5 * self._width * np.exp(1j * self._phase)
        y = [(turn * (1j * rate) ** k).real for k in range(5)]
        left = np.array([-np.sin(self._yaw), np.cos(self._yaw), 0.0])
        position_w = self._start_w + (y[0] + 0.5 * self._width) * left
        velocity_w, acceleration_w, jerk_w, snap_w = (dy * left for dy in y[1:])
        return Answer(position_w, velocity_w, acceleration_w, jerk_w, snap_w, self._yaw)


behavior = Sway  # the name that the vehicle imports
PROTOCOL = 1  # of what it imports: docs/extending/plugins.md
