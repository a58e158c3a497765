"""Messages between the vehicles of a formation, and how they are lost and delayed on their way.

A message has 18 bytes and 7 for each bearing: 46 bytes of five vehicles, which at 30 Hz are
1.4 kB/s of each vehicle. There is no position in it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from bearing_sim.sampling import DelayLine, Draws
from console.experiments.together import Company
from extensions.formations.options import MessageParameters
from quadrotor.plain_rotations import Triple

_HEAD = struct.Struct("<qff2B")
_BEARING = struct.Struct("<B3h")
_UNIT = 32767.0


@dataclass(frozen=True, slots=True)
class Message:
    """A message that a vehicle broadcasts.

    Attributes:
        yaw: its own estimate, rad. distance: m, measured to the vehicle after it; 0 for none.
        bearings_y: by vehicle, unit vectors (3,) in its yaw frame.
    """

    stamp_ns: int
    yaw: float
    distance: float
    bearings_y: dict[int, Triple]

    def encode(self) -> bytes:
        head = _HEAD.pack(self.stamp_ns, self.yaw, self.distance, len(self.bearings_y), 0)
        rows = (
            _BEARING.pack(k, *(round(_UNIT * one) for one in bearing))
            for k, bearing in self.bearings_y.items()
        )
        return head + b"".join(rows)

    @classmethod
    def decode(cls, data: bytes) -> Message:
        stamp_ns, yaw, distance, count, _ = _HEAD.unpack_from(data)
        found: dict[int, Triple] = {}
        for place in range(count):
            k, x, y, z = _BEARING.unpack_from(data, _HEAD.size + place * _BEARING.size)
            length = (x * x + y * y + z * z) ** 0.5
            found[k] = (x / length, y / length, z / length)
        return cls(stamp_ns, yaw, distance, found)


class Inbox:
    """The messages of the others as one vehicle gets them, some of them late, some not at all."""

    def __init__(self, company: Company, parameters: MessageParameters) -> None:
        self._company, self._parameters = company, parameters
        self._line: DelayLine[tuple[int, Message]] = DelayLine()

    def arrived(self, now_ns: int) -> Iterator[tuple[int, Message]]:
        """Yield sender and message of those that have arrived; call it after each meeting."""
        for k in range(len(self._company.names)):
            mail = self._company.neighbour(k).mail if k != self._company.index else b""
            if mail and Draws(self._company.seed, k, now_ns).uniform() > self._parameters.loss:
                due_ns = now_ns + round(1e9 * self._parameters.delay)
                self._line.put(due_ns, (k, Message.decode(mail)))
        yield from self._line.due(now_ns)
