"""The cost of a simulated world with gusts for a good vehicle: limits are wider by it.

On a real vehicle nobody knows the gusts, so nothing is allowed for them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from console.evaluation.log_columns import read_parameters
from quadrotor.parameter_description import ParameterValue

STIFFNESS = 4.0
"""Position gain, in 1/s², of the gain set `standard`, whatever the vehicle flies with."""
PEAK = 3.0
"""Largest displacement by gusts, in rms."""
JUDGED, DEVIATIONS = 8.0, 2.0
"""Seconds over which an rms is judged at least; its standard deviations by chance that are allowed.

The rms of two processes with exponential autocorrelation of time τ, over T seconds, has a relative
standard deviation of sqrt(τ/T)/2.
"""


@dataclass(frozen=True, slots=True)
class World:
    """The gusts of a simulated flight.

    Attributes:
        displacement: m rms, by which gusts displace a vehicle with the gains `standard`, without a
            disturbance observer: their drag over mass and STIFFNESS, as they are slower than it.
        lasts: s, correlation time of the gusts, for which they keep an estimate off.
    """

    displacement: float = 0.0
    lasts: float = 0.0

    def widened(self, limits: Mapping[str, float]) -> dict[str, float]:
        """Return the limits of a flight, widened by the errors that gusts cause."""
        chance = 1.0 + DEVIATIONS * 0.5 * math.sqrt(self.lasts / JUDGED)
        costs = {
            "position_rms_m": chance * self.displacement,
            "position_max_m": PEAK * self.displacement,
            "within_1_percent_s": self.lasts,
        }
        return {name: limit + costs.get(name, 0.0) for name, limit in limits.items()}

    def metrics(self) -> dict[str, float]:
        """Return the displacement by gusts, by which limits are wider, where there are any."""
        return {"gusts_alone_m": self.displacement} if self.displacement else {}


def read_world(log: Path) -> World:
    """Return the gusts of a flight; none where the log has no simulated world. Raises
    LogFormatError.
    """
    return gusts_of(read_parameters(log).truth)


def gusts_of(truth: Mapping[str, ParameterValue]) -> World:
    """Return the gusts of a simulator with these parameters, named without prefix."""
    gust, mass = float(truth.get("gust", 0.0)), float(truth.get("mass", math.inf))
    drags = [float(truth.get(f"rotor_drag_{axis}", 0.0)) for axis in "xy"]
    along = math.hypot(*(drag + float(truth.get("drag", 0.0)) for drag in drags))
    lasts = float(truth.get("gust_time", 0.0)) if gust else 0.0
    return World(gust * along / (mass * STIFFNESS), lasts)
