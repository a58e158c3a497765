"""The drag in a given time: the circle that promises the most information within the limits.

The force is c - D v, with c for wind and misalignment. On whole circles the mean of v is zero, so
that c and D share no information, and that about D is the integral of v^2 over the spectral density
of the force's noise. That noise is D times the gusts: a first-order process of time constant T has
a density that falls as 1 / (1 + (w T)^2) with the rate w of the circle. With v = w r and an
acceleration a = w^2 r a second of circling gives a r + (a T)^2: the largest acceleration first, and
the largest radius. D- and E-optimal designs are the same, as D is the one unknown that the
excitation reaches (Mehra 1974).
"""

from __future__ import annotations

import math
from collections.abc import Callable

from console.experiments.client import Client
from extensions.identification.drag.evaluation import LEAST, RAMP
from extensions.identification.drag.experiment import CircledFlight, Circles
from quadrotor.constants import GRAVITY
from quadrotor.parameters import Parameters, parameter

SHARE = 0.8
"""Share of the vehicle's limits that a circle uses."""


class OptimalDragOptions(Parameters):
    """Options of the design."""

    seconds: float = parameter(20.0, unit="s", ge=LEAST, le=60.0, step=1.0)
    """of steady circling"""
    radius_max: float = parameter(0.9, unit="m", ge=0.4, le=3.0, step=0.1)
    """of the circle, which lies to the left of the take-off"""
    height: float = parameter(1.2, unit="m", ge=0.8, le=1.9, step=0.1)
    """of the circle"""


class OptimalDrag(CircledFlight):
    """The quickest circles that the limits allow."""

    name = "drag_optimal"

    def __init__(self, vehicle: str = "quad1") -> None:
        super().__init__(vehicle)
        self.parameters = OptimalDragOptions()

    @property
    def planned(self) -> float:
        """Return the approximate planned time in s."""
        return 25.0 + 2.0 * RAMP + self.parameters.seconds

    def fly(self, client: Client) -> None:
        """Choose by the vehicle's limits, and fly. Raises RefusedError when it refuses."""
        p = self.parameters
        chosen = quickest(p.radius_max, p.seconds, lambda name: float(client.parameter(name)))
        self.fly_circles(client, chosen, p.height)


def quickest(radius_max: float, seconds: float, value: Callable[[str], float]) -> Circles:
    """Return the quickest circles of at least so many seconds, for a vehicle whose parameters
    `value` returns.

    The speed is bounded by the largest speed, acceleration and tilt of a trajectory; on a smaller
    circle it is bounded by them more, so that the largest circle is the best until the speed itself
    is the bound.
    """
    tilt = math.radians(value("behavior.trajectory_tilt_max"))
    acceleration = SHARE * min(
        value("behavior.trajectory_acceleration_max"), GRAVITY * math.tan(tilt)
    )
    speed = min(
        SHARE * value("behavior.trajectory_speed_max"), math.sqrt(acceleration * radius_max)
    )
    radius = min(radius_max, speed**2 / acceleration)
    period = 2.0 * math.pi * radius / speed
    return Circles(radius, period, math.ceil((seconds + RAMP) / period))
