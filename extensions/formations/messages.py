"""Messages between the vehicles of a formation, and how they are lost and delayed on their way.

A message has 19 bytes and 7 for each bearing: 47 bytes of five vehicles. There is no position in
it. The place that the separation needs follows it in 32 bytes; together, at 30 Hz, they are
2.3 kB/s of each vehicle.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

from bearing_sim.sampling import DelayLine, Draws
from console.experiments.together import Company
from extensions.formations.options import MessageParameters
from quadrotor.plain_rotations import Triple

_HEAD = struct.Struct("<qff3B")
_BEARING = struct.Struct("<B3h")
_PLACE = struct.Struct("<q6f")
_UNIT, _WHOLE = 32767.0, 255.0
DISTANCE_SIGMA = 0.05
"""m, noise of the one measured distance."""
AHEAD, BEHIND = 0.1, 1.0
"""s, by which the stamps of a message may be ahead of and behind the clock of its receiver."""


@dataclass(frozen=True, slots=True)
class Message:
    """A message that a vehicle broadcasts.

    Attributes:
        yaw: its own estimate, rad. distance: m, measured to the vehicle after it; 0 for none.
        bearings_y: by vehicle, unit vectors (3,) in its yaw frame.
        has_left: whether it flies no more in the formation, and its place alone counts.
        pace: share of a commanded motion that it can fly.
    """

    stamp_ns: int
    yaw: float
    distance: float
    bearings_y: dict[int, Triple]
    has_left: bool = False
    pace: float = 1.0

    def encode(self) -> bytes:
        few = len(self.bearings_y), self.has_left, round(_WHOLE * self.pace)
        head = _HEAD.pack(self.stamp_ns, self.yaw, self.distance, *few)
        rows = (
            _BEARING.pack(k, *(round(_UNIT * one) for one in bearing))
            for k, bearing in self.bearings_y.items()
        )
        return head + b"".join(rows)

    @property
    def size(self) -> int:
        """Return the number of its bytes."""
        return _HEAD.size + _BEARING.size * len(self.bearings_y)

    @classmethod
    def decode(cls, data: bytes) -> Message:
        stamp_ns, yaw, distance, count, has_left, pace = _HEAD.unpack_from(data)
        found: dict[int, Triple] = {}
        for place in range(count):
            k, x, y, z = _BEARING.unpack_from(data, _HEAD.size + place * _BEARING.size)
            length = (x * x + y * y + z * z) ** 0.5
            found[k] = (x / length, y / length, z / length)
        return cls(stamp_ns, yaw, distance, found, bool(has_left), pace / _WHOLE)


class Whereabouts(NamedTuple):
    """The estimated place (m) of a vehicle and the velocity (m/s) that it flies, in world axes."""

    stamp_ns: int
    position_w: Triple
    velocity_w: Triple

    def encode(self) -> bytes:
        return _PLACE.pack(self.stamp_ns, *self.position_w, *self.velocity_w)

    @classmethod
    def decode(cls, data: bytes) -> Whereabouts:
        stamp_ns, x, y, z, u, v, w = _PLACE.unpack(data)
        return cls(stamp_ns, (x, y, z), (u, v, w))


class Radio:
    """The link of one vehicle to the others, some of whose messages are late, some lost.

    Attributes:
        own: place that is broadcast with the next message. places: newest of each other vehicle.
        sent: the newest own message. mute: whether nothing is broadcast.
        pace: share of a commanded motion that keeps this vehicle away from those that do not fly
            with it. in_the_way: name of the one that it is kept away from, or "".
        has_left: whether the own place alone is broadcast, for the separation. left: vehicles
            that have told so.
        absent: vehicles that are known not to be there, and so need not be heard.
        apart: s, by vehicle, by which its stamps are ahead of the own clock; its messages are not
            used.
    """

    def __init__(self, company: Company, parameters: MessageParameters) -> None:
        self._company, self._parameters = company, parameters
        self._line: DelayLine[tuple[int, bytes]] = DelayLine()
        self.own: Whereabouts | None = None
        self.places: dict[int, Whereabouts] = {}
        self.sent: Message | None = None
        self.mute = self.has_left = False
        self.pace, self.in_the_way = 1.0, ""
        self.left: set[int] = set()
        self.absent: set[int] = set()
        self.apart: dict[int, float] = {}

    def send(self, message: Message) -> None:
        """Broadcast a message, and the own place."""
        if self.has_left:
            message = Message(message.stamp_ns, message.yaw, 0.0, {}, has_left=True)
        self.sent = message
        ahead_ns = round(1e9 * self._parameters.clock)
        own = self.own and self.own._replace(stamp_ns=self.own.stamp_ns + ahead_ns)
        sent = replace(message, stamp_ns=message.stamp_ns + ahead_ns)
        if not (self.mute or self._is_cut(message.stamp_ns)):
            self._company.broadcast(sent.encode() + (own.encode() if own else b""))

    def _is_cut(self, now_ns: int) -> bool:
        return 0.0 < self._parameters.cut <= 1e-9 * now_ns

    def arrived(self, now_ns: int) -> Iterator[tuple[int, Message]]:
        """Yield sender and message of those that have arrived, but for those that have left, and
        those whose stamps contradict the own clock.

        It is called after each meeting.
        """
        for k in range(len(self._company.names)):
            mail = self._company.neighbour(k).mail if k != self._company.index else b""
            if mail and Draws(self._company.seed, k, now_ns).uniform() > self._parameters.loss:
                self._line.put(now_ns + round(1e9 * self._parameters.delay), (k, mail))
        for k, mail in self._line.due(now_ns):
            message = Message.decode(mail)
            ahead = 1e-9 * (message.stamp_ns - now_ns) - self._parameters.clock
            if self._is_cut(now_ns):
                continue
            if not -BEHIND <= ahead <= AHEAD:
                self.apart[k] = ahead
                continue
            self.apart.pop(k, None)
            if place := mail[message.size :]:
                self.places[k] = Whereabouts.decode(place)
            if message.has_left:
                self.left.add(k)
            else:
                self.left.discard(k)
                yield k, message
