"""Faults of the room: air that rises or is pushed down at a place, and a wall.

Air acts through the vehicle's drag and its loss of thrust by inflow, as the wind does.
"""

from __future__ import annotations

import math
from typing import Any

from bearing_sim.faults.fault import Memory
from bearing_sim.faults.schedule import Moment
from quadrotor.parameters import parameter
from vehicle.simulator.faults.truth import Truth, VehicleFault


def _place(axis: str) -> Any:
    return parameter(
        0.0, unit="m", ge=-20, le=20, step=0.1, description=f"of its middle, along {axis}_W"
    )


class Updraught(VehicleFault):
    """A vertical column of rising air, fastest in its middle."""

    name = "world.updraught"
    source = (
        "Gaussian profile as of a thermal: M. J. Allen, Updraft model for development of "
        "autonomous soaring uninhabited air vehicles, AIAA 2006-1510, simplified"
    )
    varies = True

    x: float = _place("x")
    y: float = _place("y")
    radius: float = parameter(0.5, unit="m", ge=0.05, le=20, step=0.05)
    """distance from the middle at which the speed is 61 % of its largest"""
    speed: float = parameter(1.0, unit="m/s", ge=-10, le=10, step=0.1)
    """largest speed, upwards"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        speed = _column(truth, self.x, self.y, self.radius) * self.speed
        truth.parameters.wind_z += moment.level * speed


class Wake(VehicleFault):
    """A vehicle flies over this one along a line: a column of falling air that moves."""

    name = "world.wake"
    source = (
        "Gaussian jet below rotors; G. Shi et al., Neural-Swarm, ICRA 2020, measured its force; "
        "the profile is assumed"
    )
    varies = True

    x: float = _place("x")
    y: float = _place("y")
    speed_x: float = parameter(0.0, unit="m/s", ge=-10, le=10, step=0.1)
    """speed of the column along x_W"""
    speed_y: float = parameter(0.0, unit="m/s", ge=-10, le=10, step=0.1)
    """speed of the column along y_W"""
    radius: float = parameter(0.3, unit="m", ge=0.05, le=5, step=0.05)
    """distance from the middle at which the speed is 61 % of its largest"""
    speed: float = parameter(3.0, unit="m/s", ge=0, le=20, step=0.1)
    """largest speed, downwards"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        x, y = self.x + self.speed_x * moment.elapsed, self.y + self.speed_y * moment.elapsed
        truth.parameters.wind_z -= moment.level * self.speed * _column(truth, x, y, self.radius)


class Wall(VehicleFault):
    """A wall across x_W or y_W draws the vehicle to it, more the nearer it is."""

    name = "world.wall"
    source = "exponential; assumed, not fitted to data"
    of = ("axis", "at")
    varies = True

    axis: str = parameter("x", choices=("x", "y"))
    """world axis across which it stands"""
    at: float = parameter(2.0, unit="m", ge=-20, le=20, step=0.1)
    """place on this axis"""
    force: float = parameter(0.5, unit="N", ge=-5, le=5, step=0.1)
    """force towards the wall at it; below 0 away from it"""
    reach: float = parameter(0.3, unit="m", ge=0.05, le=5, step=0.05)
    """distance in which the force falls to 37 %"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        away = self.at - float(truth.position_w["xy".index(self.axis)])
        pull = moment.level * self.force * math.exp(-abs(away) / self.reach)
        name, before = f"push_{self.axis}", getattr(truth.parameters, f"push_{self.axis}")
        setattr(truth.parameters, name, before + math.copysign(pull, away * pull))


def _column(truth: Truth, x: float, y: float, radius: float) -> float:
    """Return the share, 0 to 1, of a column's largest speed at the vehicle's place."""
    far = math.hypot(float(truth.position_w[0]) - x, float(truth.position_w[1]) - y) / radius
    return math.exp(-0.5 * far * far)


WORLD: tuple[type[VehicleFault], ...] = (Updraught, Wake, Wall)
