"""A change from one estimate to another without a jerk."""

from __future__ import annotations

import numpy as np

from quadrotor.records import Record


class Fade:
    """The difference of two estimates in position and velocity, faded out after a change from one
    to the other so that the flight goes on without a jerk. The attitude changes at once.
    """

    TIME = 0.3
    """s, time constant."""
    LARGEST = 1.0
    """m and m/s; a larger difference, or one that is not finite, is not faded."""

    def __init__(self) -> None:
        self._offsets = np.zeros((2, 3))
        self.on = False

    def begin(self, before: Record, after: Record) -> None:
        """Begin at a change from STATE `before` to STATE `after`, both (1,)."""
        for k, name in enumerate(("position_w", "velocity_w")):
            self._offsets[k] = before[name][0] - after[name][0]
        size = float(np.abs(self._offsets).max())
        self.on = size < self.LARGEST  # NaN is not

    def step(self, dt: float, state: Record) -> None:
        """Add the rest of the jump to the STATE (1,) in use, dt (s) after the last call."""
        self._offsets *= np.exp(-dt / self.TIME)
        state["position_w"][0] += self._offsets[0]
        state["velocity_w"][0] += self._offsets[1]
        self.on = bool(np.abs(self._offsets).max() > 1e-4)
