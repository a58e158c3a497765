"""Vehicles without dynamics, each with the program of a formation on board."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from console.experiments.together import Neighbour
from extensions.formations.mathematics.rigidity import yaw_rotation
from extensions.formations.messages import Whereabouts
from extensions.formations.options import FormationOptions
from extensions.formations.pilot import STEP, Pilot
from extensions.formations.separation import Guard
from extensions.formations.shape import shape_of
from quadrotor.records import Array

MEETING = 0.01
"""s"""
DESCENT = 0.4
"""m/s"""
LIMITS = np.array([1.0, 1.0, 0.5])
"""m/s"""


class Here:
    """One vehicle of the flock, as its program meets the others."""

    def __init__(self, flock: Flock, index: int) -> None:
        self._flock, self.index, self.seed = flock, index, 100 + index
        self.names = [f"quad{k + 1}" for k in range(flock.count)]
        self.events: list[str] = []
        self.logged: list[tuple[str, int]] = []
        self.mail = self.arriving = b""
        self.calls: list[Callable[[int], None]] = []

    def attitude(self) -> tuple[float, float, float, float]:
        return self._flock.quaternion(self.index)

    def neighbour(self, index: int) -> Neighbour:
        return self._flock.met[index]

    def broadcast(self, mail: bytes) -> None:
        self.mail = mail

    def log(self, topic: str, type_name: str, payload: bytes, stamp_ns: int, log_ns: int) -> None:
        self.logged.append((topic, stamp_ns))

    def event(self, line: str) -> None:
        self.events.append(line)

    def at_meetings(self, call: Callable[[int], None]) -> None:
        self.calls.append(call)


class Flock:
    """Vehicles that fly the velocity that their programs ask for.

    Args:
        options: one for each vehicle. lag: s, time constant with which velocity and yaw rate
            follow, as `pilot.AS_LATE` makes them equally late; 0 for exactly. localise: vehicles
            that estimate where the others are.
    """

    def __init__(
        self,
        options: Sequence[FormationOptions],
        places: Array,
        yaws: Array,
        lag: float = 0.0,
        localise: Sequence[int] = (),
    ) -> None:
        self.count = len(options)
        self.places, self.yaws = places.copy(), yaws.copy()
        self.velocities, self.turning = np.zeros_like(places), np.zeros(self.count)
        self.now_ns = 0
        self.shape = shape_of(options[0].desired, self.count)
        self.all = [Here(self, k) for k in range(self.count)]
        self.pilots = [
            Pilot(here, p, self.shape, here.index in localise)
            for here, p in zip(self.all, options, strict=True)
        ]
        self.guards = [
            Guard(here, pilot.radio) for here, pilot in zip(self.all, self.pilots, strict=True)
        ]
        self._wanted, self._next_ns = np.zeros_like(places), 0
        self.met: list[Neighbour] = []
        self.meet()
        self.nearest, self._share = math.inf, MEETING / max(MEETING, lag)
        self._landing: set[int] = set()

    def meet(self) -> None:
        """Let all vehicles leave their places, and hand on what they have broadcast."""
        for here in self.all:
            here.arriving, here.mail = here.mail, b""
        motions = zip(self.places.tolist(), self.velocities.tolist(), self.all, strict=True)
        self.met = [
            Neighbour(
                self.now_ns,
                tuple(place),
                tuple(velocity),
                self.quaternion(here.index),
                radius=0.377,
                mail=here.arriving,
            )
            for place, velocity, here in motions
        ]

    def quaternion(self, index: int) -> tuple[float, float, float, float]:
        half = 0.5 * float(self.yaws[index])
        return math.cos(half), 0.0, 0.0, math.sin(half)

    def begin(self) -> None:
        """Let the programs hear each other before they steer."""
        self.fly(0.2)
        for pilot in self.pilots:
            pilot.is_flying = True

    def land(self, index: int) -> None:
        """Let a vehicle leave the formation and land."""
        self._landing.add(index)
        self.pilots[index].is_flying = False
        self.pilots[index].radio.has_left = True

    def bring_back(self, index: int) -> None:
        """Let a vehicle that has left be part of the formation again."""
        self._landing.discard(index)
        self.pilots[index].is_flying = True
        self.pilots[index].radio.has_left = False

    def fly(self, seconds: float) -> None:
        i, j = np.triu_indices(self.count, 1)
        for _ in range(round(seconds / MEETING)):
            self.now_ns += round(1e9 * MEETING)
            self.meet()
            for here in self.all:
                for call in here.calls:
                    call(self.now_ns)
            if self.now_ns >= self._next_ns:
                self._next_ns = self.now_ns + round(1e9 * STEP)
                self._command()
            self.velocities += self._share * (self._wanted - self.velocities)
            rates = np.array([pilot.yaw_rate for pilot in self.pilots])
            self.turning += self._share * (rates - self.turning)
            self.yaws += MEETING * self.turning
            self.places += MEETING * self.velocities
            apart = np.linalg.norm(self.places[i] - self.places[j], axis=1)
            self.nearest = min(self.nearest, float(apart.min()))

    def _command(self) -> None:
        """Command the velocity that each vehicle follows."""
        for k, pilot in enumerate(self.pilots):
            wanted, here, asked = pilot.velocity_y, self.places[k], pilot.commanded_y
            if pilot.is_flying:
                wanted = self.guards[k].keep(wanted, here, self.now_ns, LIMITS, asked)
            self._wanted[k] = yaw_rotation(self.yaws[k]) @ wanted
            if k in self._landing:
                self._wanted[k] = 0.0, 0.0, -DESCENT if here[2] > 0.0 else 0.0
                place, velocity = here.tolist(), self.velocities[k].tolist()
                pilot.radio.own = Whereabouts(self.now_ns, tuple(place), tuple(velocity))

    def error(self, left: Sequence[int] = ()) -> float:
        """Return the rms angle, deg, of the true bearings to the desired ones."""
        total, count = 0.0, 0
        for (i, j), wanted in self.shape.desired.items():
            if i in left or j in left:
                continue
            x, y, z = self.places[j] - self.places[i]
            c, s = math.cos(self.yaws[i]), math.sin(self.yaws[i])
            true = np.array([c * x + s * y, c * y - s * x, z])
            cosine = float(true @ wanted) / float(np.linalg.norm(true))
            total, count = total + math.acos(max(-1.0, min(1.0, cosine))) ** 2, count + 1
        return math.degrees(math.sqrt(total / count))

    def events(self) -> list[str]:
        return [line for here in self.all for line in here.events]
