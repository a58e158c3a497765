"""The program on board of each vehicle of a formation: from bearings and messages to sticks.

It uses the vehicle's own bearings, its own estimate of its attitude, and the others' messages. It
never sees a position of anybody: those that `separation` uses, beneath it, are in its radio alone.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping

import numpy as np

from bearing_sim.sampling import Draws, pair
from console.experiments.together import Company
from control.trajectories.velocity_filter import BANDWIDTH
from extensions.formations.localiser import Localiser
from extensions.formations.mathematics.law import Gains, formation_velocity
from extensions.formations.mathematics.steering import NullMotion, steering_pace, steering_velocity
from extensions.formations.messages import DISTANCE_SIGMA, Message, Radio
from extensions.formations.options import FormationOptions
from extensions.formations.relative_bearings import RelativeBearings
from extensions.formations.shape import Edge, Shape
from extensions.formations.suspicion import Suspicion
from extensions.formations.view import COUNTED, View
from quadrotor.plain_rotations import Triple, rows_of
from quadrotor.records import Array
from vehicle_link.topics.measurements import encode_bearings

FRESH, SILENT = 0.5, 1.0
"""Ages, s, up to which bearings and messages are used, and above which a vehicle is silent."""
SPEED, YAW_RATE = 0.7, 0.6
"""Limits of the law, m/s and rad/s."""
STEP = 0.02
"""s between two commands."""
AS_LATE = 1.0 - math.exp(-BANDWIDTH * STEP)
"""Share of a step by which yaw rates follow: the reference's velocity passes three poles, its yaw
rate two, and a formation that turns keeps its bearings when both are equally late."""
SECOND = 1_000_000_000
REMEMBERED = 64
"""Frames whose own yaw is remembered, for messages that arrive late: 2 s."""


class Pilot:
    """The program on board.

    Args:
        localises: whether it estimates where the others are, for the log.

    Attributes:
        command: the null motion that is commanded, in the yaw frame of the first vehicle that
            flies.
        velocity_y, yaw_rate: what it wants to fly, m/s and rad/s. commanded_y: its part of the
            whole commanded motion, m/s.
        eigenvalue: of the formation by the edges that count; least: the smallest so far.
        is_flying: whether it steers, and so, after a second, tells what it misses.
        localiser: estimates where the others are; None for nothing.
        radio: the link to the others. desired_yaw: rad, of this vehicle in the desired shape.
    """

    def __init__(
        self, company: Company, options: FormationOptions, shape: Shape, localises: bool = False
    ) -> None:
        self._company, self._shape, self._options = company, shape, options
        self._own = company.index
        parameters = options.bearings.model_copy()
        parameters.seed = (options.bearings.seed + company.seed) % (2**31 - 1)
        self._sensor = RelativeBearings(parameters, company, options.occlusion)
        self.desired_yaw = float(shape.yaws[self._own])
        self.radio = Radio(company, options.messages)
        self._newest: dict[int, Message] = {}
        self._yaws: deque[tuple[int, float]] = deque(maxlen=REMEMBERED)
        self._suspicion, self._out = Suspicion(), set[int]()
        self._silent: set[int] = set()
        sigma = math.radians(options.bearings.sigma)
        self.localiser = Localiser(company, self.radio, sigma) if localises else None
        self._gains = Gains(options.gain, 1.0, SPEED, YAW_RATE, sigma)
        self._was_rigid, self._is_slow, self._slow_ns = True, False, -SECOND
        self._view = View(options.bearings)
        self.command, self.is_flying = NullMotion(), False
        self._tells, self._idle_ns = False, 0
        self.velocity_y: Array = np.zeros(3)
        self.commanded_y: Array = np.zeros(3)
        self.yaw_rate = self.eigenvalue = 0.0
        self.least = math.inf
        company.at_meetings(self._met)

    def _met(self, now_ns: int) -> None:
        self._sensor.look()
        localiser = self.localiser if self.is_flying else None
        for k, message in self.radio.arrived(now_ns):
            self._newest[k] = message
            self._suspicion.note(k, self._newest)
            if localiser is not None:
                localiser.note(k, message)
        for frame in self._sensor.due(now_ns):
            ids = frame.beacon_ids.tolist()
            payload = encode_bearings(
                frame.stamp_ns, ids, frame.bearings_b, frame.sigma, self._company.names[self._own]
            )
            kind = "quadlab_msgs/BearingArray"
            self._company.log("neighbour_bearings", kind, payload, frame.stamp_ns, now_ns)
            self._see(frame.stamp_ns, dict(zip(ids, frame.bearings_b.tolist(), strict=True)))
            self._decide(now_ns)
            if localiser is not None:
                localiser.note(self._own, self._newest[self._own])
                localiser.step(self._fresh(now_ns, SILENT).keys() - self._out, now_ns)

    def _see(self, stamp_ns: int, bearings_b: dict[int, Triple]) -> None:
        """Turn a frame to the yaw frame, and broadcast it."""
        rows = rows_of(self._company.attitude())
        yaw = math.atan2(rows[1][0], rows[0][0])
        c, s = math.cos(yaw), math.sin(yaw)
        found: dict[int, Triple] = {}
        for number, bearing in bearings_b.items():
            x, y, z = (sum(a * b for a, b in zip(row, bearing, strict=True)) for row in rows)
            found[number - 1] = (c * x + s * y, c * y - s * x, z)
        self._yaws.append((stamp_ns, yaw))
        leads = self._leader(self._fresh(stamp_ns)) == self._own
        distance = self._distance(stamp_ns) if leads else 0.0
        message = Message(stamp_ns, yaw, distance, found, pace=self.radio.pace)
        self._newest[self._own] = message
        self.radio.send(message)

    def _distance(self, stamp_ns: int) -> float:
        """Return the distance that this vehicle measures to the one after it, for the scale."""
        pair_of = self._own, self._own + 1
        here, there = (np.array(self._company.neighbour(k).position_w) for k in pair_of)
        noise = pair(Draws(self._company.seed, 1, stamp_ns), math.inf)[0]
        return float(np.linalg.norm(there - here)) + DISTANCE_SIGMA * noise

    def _fresh(self, now_ns: int, age: float = FRESH) -> dict[int, Message]:
        """Return the messages that are used, the own one among them."""
        return {
            k: one
            for k, one in self._newest.items()
            if now_ns - one.stamp_ns <= age * SECOND or k == self._own
        }

    @staticmethod
    def _leader(fresh: Mapping[int, Message]) -> int | None:
        """Return the first vehicle that flies with the one after it: it measures the distance of
        both, and commands are in its yaw frame.
        """
        return next((k for k in sorted(fresh) if k + 1 in fresh), None)

    def _turned(self, message: Message) -> float:
        """Return the own yaw less that of another vehicle, rad, both at the stamp of its message:
        in a formation that turns, it has turned on by the time that the message arrives.
        """
        nearest_ns, yaw = self._yaws[-1]
        for stamp_ns, other in reversed(self._yaws):
            if abs(stamp_ns - message.stamp_ns) > abs(nearest_ns - message.stamp_ns):
                break
            nearest_ns, yaw = stamp_ns, other
        return math.remainder(yaw - message.yaw, 2.0 * math.pi)

    def _decide(self, now_ns: int) -> None:
        fresh = self._fresh(now_ns)
        if not (self.is_flying and self._idle_ns):
            self._idle_ns = now_ns
        self._tells = now_ns - self._idle_ns > SILENT * SECOND
        if self._tells:
            self._tell(now_ns)
        edges = frozenset(
            edge
            for edge in self._shape.desired
            if edge[0] in fresh
            and edge[1] in fresh
            and edge[0] not in self._out
            and edge[1] in fresh[edge[0]].bearings_y
        )
        weights = self._weights(edges, fresh)
        # A vehicle whose bearings are left out is led by those of the others and its yaw alone.
        trusted = frozenset(fresh).difference(self._out)
        among = frozenset(edge for edge in edges if edge[1] in trusted and weights[edge] > 0.0)
        firm = frozenset(edge for edge in among if weights[edge] >= COUNTED)
        self.eigenvalue = self._shape.eigenvalue(firm, trusted)
        self.least = min(self.least, self.eigenvalue) if self.is_flying else self.least
        if not self._hold_together(among, trusted):
            self.velocity_y, self.yaw_rate = np.zeros(3), 0.0
            self.commanded_y = np.zeros(3)
            return
        own = self._own
        mine = fresh[own]
        seen = {j: mine.bearings_y[j] for i, j in edges if i == own}
        seen_by = {
            i: (fresh[i].bearings_y[own], self._turned(fresh[i])) for i, j in edges if j == own
        }
        desired = {edge: self._shape.desired[edge] for edge in edges}
        velocity_y, yaw_rate = formation_velocity(
            own, seen, seen_by, desired, self._gains, weights, yaws=self._shape.yaws
        )
        self.commanded_y, turned = self._steered(fresh)
        pace = self._pace(fresh, now_ns)
        self.velocity_y = velocity_y + pace * self.commanded_y
        self.yaw_rate = yaw_rate + pace * turned

    def _weights(self, edges: frozenset[Edge], fresh: dict[int, Message]) -> dict[Edge, float]:
        """Return the weight of each edge, which both its ends find by the same messages."""
        scale, distances = self._scale(fresh), self._shape.distances
        return {
            (i, j): self._view.weight(fresh[i].bearings_y[j], scale * distances[i][j])
            for i, j in edges
        }

    def _scale(self, fresh: dict[int, Message]) -> float:
        """Return m in a unit of the desired shape, by the one measured distance; 0: not known."""
        leader = self._leader(fresh)
        if leader is None:
            return 0.0
        return fresh[leader].distance / self._shape.distances[leader][leader + 1]

    def _steered(self, fresh: dict[int, Message]) -> tuple[Array, float]:
        """Return this vehicle's part of the whole commanded motion."""
        if not (scale := self._scale(fresh)) or (leader := self._leader(fresh)) is None:
            return np.zeros(3), 0.0
        places, yaws = self._shape.places, self._shape.yaws
        c, s = math.cos(yaws[self._own]), math.sin(yaws[self._own])
        x, y, z = scale * places[self._own]
        place_y = (c * x + s * y, c * y - s * x, z)
        return steering_velocity(self.command, place_y, self._turned(fresh[leader]))

    def _pace(self, fresh: dict[int, Message], now_ns: int) -> float:
        """Return the share of the commanded motion that all can fly; tell when it falls below 1,
        and, 1 s after, when it no longer does.
        """
        bound = self._options.eigenvalue_min
        by_rigidity = steering_pace(self.eigenvalue, bound)
        slowest = min(fresh, key=lambda k: fresh[k].pace)
        pace = min(by_rigidity, fresh[slowest].pace)
        if pace < 1.0:
            self._slow_ns = now_ns
        if self.is_flying and self._is_slow != (now_ns - self._slow_ns < SECOND):
            self._is_slow = not self._is_slow
            if by_rigidity == pace:
                told = f"its rigidity eigenvalue is {self.eigenvalue:.3f}, the bound {bound:g}"
            elif slowest == self._own:
                told = f"{self.radio.in_the_way} is in the way"
            else:
                told = f"{self._name(slowest)} cannot fly as commanded"
            slow = f"formation: it slows down; {told}"
            self._company.event(slow if self._is_slow else "formation: as fast as commanded again")
        return pace

    def _hold_together(self, edges: frozenset[Edge], vehicles: frozenset[int]) -> bool:
        """Return whether the edges in use make the formation rigid; tell when this changes."""
        is_rigid = self.eigenvalue > 0.0
        if self._tells and is_rigid != self._was_rigid:
            if is_rigid:
                self._company.event("formation: rigid again")
            elif len(vehicles) < 2:
                self._company.event("formation: no other vehicle is in contact; it brakes")
            else:
                lacking = ", ".join(
                    f"{self._name(i)} to {self._name(j)}"
                    for i, j in self._shape.missing(edges, vehicles)
                )
                self._company.event(f"formation: not rigid, it brakes; it lacks {lacking}")
            self._was_rigid = is_rigid
        return is_rigid

    def _tell(self, now_ns: int) -> None:
        """Tell who is silent, and whose bearings contradict those of the others."""
        for k, name in enumerate(self._company.names):
            if k in self.radio.absent:
                continue
            newest = self._newest.get(k)
            is_silent = newest is None or now_ns - newest.stamp_ns > SILENT * SECOND
            if is_silent and k not in self._silent and k != self._own:
                self._silent.add(k)
                self._suspicion.forget(k)
                self._company.event(f"formation: {self._why_silent(k)}")
            elif not is_silent and k in self._silent:
                self._silent.remove(k)
                self._company.event(f"formation: {name} is heard again")
        suspect = self._suspicion.worst()
        if suspect is not None and suspect not in self._out:
            self._out.add(suspect)
            self._suspicion.forget(suspect)
            self._company.event(
                f"formation: the bearings of {self._name(suspect)} contradict those of the "
                "others; they are left out"
            )

    def _why_silent(self, k: int) -> str:
        name = self._name(k)
        if k in self.radio.left:
            return f"{name} has left"
        if (ahead := self.radio.apart.get(k)) is not None:
            side = "ahead of" if ahead > 0.0 else "behind"
            return (
                f"the stamps of {name} are {abs(ahead):.1f} s {side} the clock of "
                f"{self._name(self._own)}; it is left out: set its clock"
            )
        return f"{name} is silent; it is left out"

    def _name(self, k: int) -> str:
        return self._company.names[k]
