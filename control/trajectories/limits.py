"""The limits of a trajectory, quantity by quantity."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity of `feasibility.survey`: name, unit and scale for display, and its limit."""

    name: str
    unit: str
    source: str  # the parameters that set the limit
    sign: float = 1.0  # -1: its least value counts
    scale: float = 1.0  # shown = sign * scale * demanded


QUANTITIES = (
    *(
        Quantity(axis, "m", f"behavior.volume_{axis}_min, behavior.volume_{axis}_max", sign)
        for axis in "xyz"
        for sign in (-1.0, 1.0)
    ),
    Quantity("speed", "m/s", "behavior.trajectory_speed_max"),
    Quantity("acceleration", "m/s²", "behavior.trajectory_acceleration_max"),
    Quantity("yaw rate", "rad/s", "behavior.yaw_rate_max"),
    Quantity("yaw acceleration", "rad/s²", "behavior.yaw_acceleration_max"),
    Quantity("tilt", "°", "behavior.trajectory_tilt_max", scale=math.degrees(1.0)),
    Quantity(
        "least motor thrust", "N", "the motors' least and behavior.trajectory_thrust_margin", -1.0
    ),
    Quantity("largest motor thrust", "N", "the motors' most and behavior.trajectory_thrust_margin"),
    Quantity("body rate", "rad/s", "behavior.trajectory_body_rate_max"),
    Quantity("yaw torque", "N m", "behavior.trajectory_yaw_torque_max"),
)
"""Quantities in the order of `feasibility.survey`, in which breaches are reported."""

WALLS = 6
"""Number of quantities of the flight volume, which come first."""


@dataclass(frozen=True, slots=True)
class Limits:
    """The smallest and largest allowed values, SI; a value that is omitted has no limit.

    Args:
        thrust_low, thrust_high: N per motor; leave a margin to the motors' own limits for the
            feedback, see `with_margin`.
        tilt: rad.
    """

    low_w: tuple[float, float, float] = (-math.inf, -math.inf, -math.inf)  # m
    high_w: tuple[float, float, float] = (math.inf, math.inf, math.inf)  # m
    speed: float = math.inf
    acceleration: float = math.inf
    yaw_rate: float = math.inf
    yaw_acceleration: float = math.inf
    tilt: float = math.inf
    thrust_low: float = -math.inf
    thrust_high: float = math.inf
    body_rate: float = math.inf
    yaw_torque: float = math.inf

    def as_array(self) -> Array:
        """Return (15,) in the order and with the signs of `feasibility.survey`."""
        (x0, y0, z0), (x1, y1, z1) = self.low_w, self.high_w
        # A rounding error beyond a wall does not count.
        walls = [w + 1e-6 for w in (-x0, x1, -y0, y1, -z0, z1)]
        return np.array(
            [
                *walls,
                self.speed,
                self.acceleration,
                self.yaw_rate,
                self.yaw_acceleration,
                self.tilt,
                -self.thrust_low,
                self.thrust_high,
                self.body_rate,
                self.yaw_torque,
            ]
        )


def with_margin(thrust_min: float, thrust_max: float, margin: float) -> tuple[float, float]:
    """Return the motors' range (N) less `margin`, a share of it, at both ends, for the feedback."""
    reserve = margin * (thrust_max - thrust_min)
    return thrust_min + reserve, thrust_max - reserve
