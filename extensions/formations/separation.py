"""The separation of vehicles in flight, beneath the law, which itself comes as near as it likes.

What the law asks for is changed as little as keeps the vehicles apart. Each takes half of what a
pair may close (`steering.separated_velocity`), by the places that they broadcast for this purpose
alone, from the trackers or beacons that they fly on: no distance follows from bearings until one
is measured, and this has to hold from the first instant, also with a sensor that is turned. A
vehicle that is blocked goes around to its right.

A vehicle that is no part of the formation stays where it is while the others are steered toward it.
The formation then slows down as a whole, by the share that is left to the one nearest to it, and so
keeps its shape.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from console.experiments.together import Company
from extensions.formations.mathematics.rigidity import E_Z, yaw_rotation
from extensions.formations.mathematics.steering import separated_velocity
from extensions.formations.messages import Radio, Whereabouts
from quadrotor.plain_rotations import rows_of
from quadrotor.records import Array

SEPARATION = 0.8
"""m, smallest distance of two vehicles."""
KEPT = 0.95
"""m, distance that is kept, from centre to centre: with errors of estimates and of following."""
RATE = 1.0
"""1/s, at which a pair may close what is left."""
ACCELERATION = 1.0
"""m/s^2, by which a vehicle may depart from the velocity that it has broadcast."""
AGREED_NS = 200_000_000
"""Age up to which a broadcast velocity is what both of a pair reckon with."""
SILENT = 1.0
"""Age, s, of a place above which only a bearing of its vehicle tells where it may not go."""
AROUND = 0.8
"""Share of the speed that is blocked with which a vehicle goes around."""
CREEP = 0.02
"""m/s, at which a commanded motion may bend the formation before all slow down."""
BLOCKED = 3.0
"""s of being held up before it is told."""
ASKED, SHARE = 0.15, 0.2
"""m/s asked for, and the share of it flown, below which a vehicle is held up."""
SECOND = 1_000_000_000


class Guard:
    """The part of a vehicle that keeps it apart from the others.

    Args:
        radio: hears the places of the others, and broadcasts the own one.
    """

    def __init__(self, company: Company, radio: Radio) -> None:
        self._company, self._radio = company, radio
        self._others = [k for k in range(len(company.names)) if k != company.index]
        self._lost: dict[int, int] = {}
        self._blocked_ns: int | None = None
        self._told = False

    def keep(
        self,
        velocity_y: npt.ArrayLike,
        position_w: npt.ArrayLike,
        now_ns: int,
        limits: Array,
        commanded_y: npt.ArrayLike = (0.0, 0.0, 0.0),
    ) -> Array:
        """Return the velocity (3,) m/s to fly, in the own yaw frame as that asked for is.

        Args:
            position_w: (3,) m, the own estimate. limits: (3,) m/s, of what can be flown; a
                velocity beyond is shortened, not bent.
            commanded_y: (3,) m/s, part of the whole commanded motion, of which `Radio.pace` then is
                the share that may be flown.
        """
        rows = rows_of(self._company.attitude())
        turn = yaw_rotation(math.atan2(rows[1][0], rows[0][0]))
        asked = turn @ _shortened(velocity_y, limits)
        here = np.asarray(position_w, dtype=float)
        near, missing = self._neighbours(here, now_ns)
        drift = np.array([self._drift(k, away, now_ns) for k, away in near.items()])
        self._tell_lost(missing, now_ns)
        self._note_pace(turn @ np.asarray(commanded_y, dtype=float), near, missing, now_ns)
        flown = np.zeros(3) if missing else _around(asked, near, drift)
        self._tell_blocked(asked, flown, near, now_ns)
        flown = turn.T @ _shortened(flown, limits)
        (x, y, z), (u, v, w) = here.tolist(), (turn @ flown).tolist()
        self._radio.own = Whereabouts(now_ns, (x, y, z), (u, v, w))
        return np.asarray(flown)

    def _neighbours(self, here: Array, now_ns: int) -> tuple[dict[int, Array], list[int]]:
        """Return where the others may be at the nearest, from this vehicle (m, world), and those
        of which nothing is known.
        """
        near: dict[int, Array] = {}
        missing: list[int] = []
        for k in self._others:
            if k in self._radio.absent:
                continue
            place = self._radio.places.get(k)
            age = math.inf if place is None else 1e-9 * (now_ns - place.stamp_ns)
            if place is not None and age <= SILENT:
                away = np.array(place.position_w) + age * np.array(place.velocity_w) - here
                distance = float(np.linalg.norm(away))
                reach = distance - 0.5 * ACCELERATION * age * age
                near[k] = away * (max(reach, 0.1) / max(distance, 1e-9))
            elif (sight := self._sight(k, now_ns)) is not None:
                near[k] = KEPT * sight  # it is not approached
            else:
                missing.append(k)
        return near, missing

    def _note_pace(
        self, commanded_w: Array, near: dict[int, Array], missing: list[int], now_ns: int
    ) -> None:
        """Tell the others what share of the commanded motion keeps this vehicle away from those
        that do not fly with it.
        """
        lost = [k for k in missing if self._lost[k] < 0]
        pace, why = (0.0, lost[0]) if lost else (1.0, None)
        for k, away in near.items():
            place = self._radio.places.get(k)
            is_heard = place is not None and now_ns - place.stamp_ns <= SILENT * SECOND
            if is_heard and k not in self._radio.left:
                continue
            distance = max(math.hypot(*away.tolist()), 1e-9)
            toward = float(commanded_w @ away) / distance
            room = max(0.0, 0.5 * RATE * (distance - KEPT)) + CREEP
            if room < pace * toward:
                pace, why = room / toward, k
        self._radio.pace = pace
        self._radio.in_the_way = "" if why is None else self._company.names[why]

    def _drift(self, k: int, away: Array, now_ns: int) -> float:
        """Return the mean velocity (m/s) of this vehicle and another toward the other, as both
        have broadcast; 0 where the pair cannot agree on it.
        """
        own, place = self._radio.own, self._radio.places.get(k)
        if own is None or place is None or now_ns - place.stamp_ns > AGREED_NS:
            return 0.0
        mean = 0.5 * (np.array(own.velocity_w) + np.array(place.velocity_w))
        return float(mean @ away) / max(float(np.linalg.norm(away)), 1e-9)

    def _sight(self, k: int, now_ns: int) -> Array | None:
        """Return the own bearing (3,) of a vehicle in world axes, if it is in sight."""
        sent = self._radio.sent
        if sent is None or k not in sent.bearings_y or now_ns - sent.stamp_ns > SILENT * SECOND:
            return None
        return np.asarray(yaw_rotation(sent.yaw) @ np.array(sent.bearings_y[k]))

    def _tell_lost(self, missing: list[int], now_ns: int) -> None:
        for k in self._others:
            name = self._company.names[k]
            if k not in missing:
                if self._lost.pop(k, now_ns) < 0:
                    self._company.event(f"formation: {name} is in contact again")
            elif 0 <= self._lost.setdefault(k, now_ns) <= now_ns - SECOND // 2:
                self._lost[k] = -1
                self._company.event(
                    f"formation: {name} is neither heard nor seen; to keep apart from it, this "
                    "vehicle stops"
                )

    def _tell_blocked(
        self, asked: Array, flown: Array, near: dict[int, Array], now_ns: int
    ) -> None:
        speed = float(np.linalg.norm(asked))
        if not near or speed < ASKED or np.linalg.norm(flown) > SHARE * speed:
            self._blocked_ns, self._told = None, False
            return
        if self._blocked_ns is None:
            self._blocked_ns = now_ns
        if not self._told and now_ns - self._blocked_ns > BLOCKED * SECOND:
            self._told = True
            names = [
                self._company.names[k]
                for k, away in near.items()
                if float(away @ asked) > 0.0 and np.linalg.norm(away) < KEPT + 2.0 * speed / RATE
            ]
            self._company.event(
                f"formation: {' and '.join(names) or 'others'} in the way; to keep "
                f"{SEPARATION} m apart, this vehicle stops"
            )


def _around(asked: Array, near: dict[int, Array], drift: Array) -> Array:
    """Return the velocity (3,) nearest to that asked for that keeps apart, around to the right of
    those that block it.
    """
    others = np.array(list(near.values())).reshape(-1, 3)
    flown = separated_velocity(asked, others, KEPT, RATE, drift)
    blocked = asked - flown
    if float(np.abs(blocked).max(initial=0.0)) < 1e-3:
        return flown
    return separated_velocity(asked + AROUND * np.cross(blocked, E_Z), others, KEPT, RATE, drift)


def _shortened(velocity: npt.ArrayLike, limits: Array) -> Array:
    v = np.asarray(velocity, dtype=float)
    return np.asarray(v / max(1.0, float((np.abs(v) / limits).max())))
