"""Fly a path that looks around on bearings to beacons, planned anew each half second in flight."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from bearing_sim.beacons import parse_layout
from console.experiments.bearings import BearingsExperiment, BearingsOptions
from console.experiments.client import Client
from extensions.formations.mathematics.active_sensing import (
    SAMPLES,
    STEP,
    LookAround,
    Room,
    Sights,
    carried,
    gramian,
)
from extensions.formations.mathematics.look_around import START
from quadrotor.errors import UsageError
from quadrotor.parameters import parameter
from quadrotor.records import Array

RATE = 50
"""Hz, of the sticks."""
GAIN = 1.0
"""1/s, from the distance to the planned place to velocity."""
LOWEST, HIGHEST = 0.5, 1.9
"""m, of the path."""
SPEEDS = "behavior.joy_speed_xy", "behavior.joy_speed_xy", "behavior.joy_speed_z"


class LookAroundOptions(BearingsOptions):
    """Options: those of the experiment `bearings`, and the shape of the path."""

    path: str = parameter("look_around", choices=("look_around", "straight"))
    """planned for the most information; or straight, to and fro along x, for comparison"""
    radius: float = parameter(1.0, unit="m", ge=0.2, le=2.0, step=0.1)
    """about the place of take-off, which the path keeps to"""
    speed: float = parameter(0.5, unit="m/s", ge=0.1, le=0.5, step=0.05)
    """largest, of the path"""


class LookAroundExperiment(BearingsExperiment):
    """Take-off on the tracker, hand-over, a path that looks around, landing; judged on the path.

    The path is planned from the vehicle's own estimate of its place, by its beacons and the
    sensor's usual noise, and flown by sticks.
    """

    name = "look_around"

    def __init__(self, vehicle: str = "quad1") -> None:
        super().__init__(vehicle)
        self.parameters: LookAroundOptions = LookAroundOptions()

    def check(self) -> None:
        """Raise UsageError for options that do not go together."""
        super().check()
        if self.parameters.manoeuvre != "hover":
            raise UsageError(
                f"experiment.manoeuvre={self.parameters.manoeuvre}: look_around flies its own; "
                "choose experiment.path, or fly the experiment bearings"
            )

    def _manoeuvre(self, client: Client, sticks: npt.NDArray[np.float64]) -> None:
        p = self.parameters
        x, y, z = client.view().position_w.tolist()
        client.start("fly_to", x=x, y=y, z=z, yaw=0.0)  # sticks are then along the world's axes
        client.wait_until(
            lambda v: v.behavior != "fly_to" or self._over(client), what="the turn", timeout=20
        )
        limits = np.array([float(client.parameter(name)) for name in SPEEDS])
        room = Room((x, y, z), p.radius, LOWEST, HIGHEST, p.speed)
        path = (
            Planned(room, str(client.parameter("beacons.layout")))
            if p.path == "look_around"
            else Straight(room)
        )
        end = client.view().time + p.duration
        client.start("velocity")
        while (view := client.view()).time < end and not self._over(client):
            if view.behavior != "velocity":
                break
            place, velocity = path.at(view.position_w)
            u, v, w = (velocity + GAIN * (place - view.position_w)) / limits
            client.sticks((u, v, w, 0.0))
            client.wait(1.0 / RATE)
        self._brake(client)


class Planned:
    """A path that is planned again and again from the bearings seen along the path flown so far."""

    def __init__(self, room: Room, layout: str) -> None:
        self._sights = Sights(parse_layout(layout).positions_w)
        self._plan, self._information = LookAround(room, self._sights), np.linalg.inv(START)
        self._flown: list[Array] = []
        self._step = 0

    def at(self, here: Array) -> tuple[Array, Array]:
        """Return the place (m) and velocity (m/s), world, to be flown now; call it at RATE."""
        of = round(STEP * RATE)
        if self._step % of == 0:
            if self._step:
                self._advance(np.array([*self._flown, here]))
            self._flown = []
            self._plan.plan(np.linalg.inv(self._information))
        if self._step % (of // SAMPLES) == 0:
            self._flown.append(np.array(here))
        place, velocity, _ = self._plan.at([(self._step % of) / RATE])
        self._step += 1
        return place[0], velocity[0]

    def _advance(self, path: Array) -> None:
        times = np.linspace(0.0, STEP, len(path))
        travel = path[-1] - path[0]
        self._information = carried(self._information, travel, STEP, self._sights) + gramian(
            path[1:], times[1:], self._sights
        )
        self._plan.advance()


class Straight:
    """A path to and fro along x, as far as the radius."""

    def __init__(self, room: Room) -> None:
        self._room, self._time = room, 0.0

    def at(self, here: Array) -> tuple[Array, Array]:
        """Return the place (m) and velocity (m/s), world, to be flown now; call it at RATE."""
        room = self._room
        rate = room.speed / room.radius
        phase, self._time = rate * self._time, self._time + 1.0 / RATE
        x, y, z = room.centre_w
        place = np.array([x + room.radius * math.sin(phase), y, z])
        return place, np.array([room.speed * math.cos(phase), 0.0, 0.0])
