"""The places of the others by bearings, as each vehicle of a formation estimates them for itself.

It hears what all broadcast: their bearings and yaws, the velocities that they fly, and the one
measured distance. It is told no place of anybody. The law does not use it.
"""

from __future__ import annotations

import math
from collections.abc import Set as AbstractSet
from functools import cache

import numpy as np

from console.experiments.together import Company
from control.trajectories.velocity_filter import BANDWIDTH
from extensions.formations.mathematics.localisation import MotionNoise, NetworkFilter
from extensions.formations.mathematics.rigidity import yaw_rotation
from extensions.formations.messages import DISTANCE_SIGMA, Message, Radio
from quadrotor.errors import DegenerateGeometryError
from quadrotor.plain_rotations import Triple
from quadrotor.records import Array
from vehicle_link.messages.cdr_layout import FixedLayout
from vehicle_link.topics.ticks import set_stamps

TOPIC, TYPE = "place_of_", "geometry_msgs/PoseWithCovarianceStamped"
"""Before the name of the other vehicle; a place in the own yaw frame, and the yaw less the own."""
EACH = 3
"""Frames of bearings between two estimates that are logged."""
LATE_NS = 500_000_000
"""Time for which a frame waits for messages that may still arrive."""
NOISE = MotionNoise(velocity=0.02, yaw_rate=0.01, tells_scale=False)
"""Of the velocities that vehicles are asked to fly, which they follow late and not exactly."""
MISFITS = 30
"""Frames in a row of whose bearings less than half fit, after which the filter begins anew."""


class Localiser:
    """The filter of the network, on board of one vehicle.

    Args:
        radio: hears the others. sigma: rad, of a bearing on each tangent axis.

    Attributes:
        filter: of the vehicles `members`, in this order; None until a frame determines the shape.
    """

    def __init__(self, company: Company, radio: Radio, sigma: float) -> None:
        self._company, self._radio, self._sigma = company, radio, sigma
        self.filter: NetworkFilter | None = None
        self.members: list[int] = []
        self._frames: dict[int, dict[int, tuple[Message, Triple]]] = {}
        self._heard_ns: dict[int, int] = {}
        self._motions: dict[int, Motion] = {}
        self._stamp_ns = self._misfits = self._count = 0

    def note(self, k: int, message: Message) -> None:
        """Note the newest message of a vehicle, and the velocity that came with it."""
        own = k == self._company.index
        place = self._radio.own if own else self._radio.places.get(k)
        if place is not None and message.stamp_ns > self._stamp_ns:
            self._frames.setdefault(message.stamp_ns, {})[k] = message, place.velocity_w
            self._heard_ns[k] = message.stamp_ns

    def step(self, members: AbstractSet[int], now_ns: int) -> None:
        """Use the frames that are complete, or will not be, and log the estimate.

        Args:
            members: vehicles that are heard and whose bearings are trusted, this one too: without
                its bearings nothing tells the yaw of a vehicle.
        """
        if self.members != (chosen := sorted(members)):
            self.members, self.filter = chosen, None
        while self._frames:
            stamp_ns = min(self._frames)
            newest = min(self._heard_ns.get(k, 0) for k in self.members)
            if newest < stamp_ns and now_ns - stamp_ns < LATE_NS:
                break
            frame = self._frames.pop(stamp_ns)
            self._use(stamp_ns, frame)
            if self.filter is not None and self._company.index in frame:
                self._count += 1
                if self._count % EACH == 0:
                    self._log(stamp_ns, now_ns)

    def _use(self, stamp_ns: int, frame: dict[int, tuple[Message, Triple]]) -> None:
        dt = 1e-9 * (stamp_ns - self._stamp_ns)
        self._stamp_ns = stamp_ns
        for k, (message, velocity_w) in frame.items():
            self._motions.setdefault(k, Motion()).follow(message, velocity_w)
        number = {k: place for place, k in enumerate(self.members)}
        seen = {
            (number[i], number[j]): bearing_y
            for i, (message, _) in frame.items()
            for j, bearing_y in message.bearings_y.items()
            if i in number and j in number
        }
        own = number.get(self._company.index)
        if own is None or not seen:
            return
        edges, bearings = list(seen), np.array(list(seen.values()))
        if self.filter is None:
            try:
                self.filter = NetworkFilter.from_bearings(
                    own, len(number), bearings, edges, self._sigma, noise=NOISE
                )
            except DegenerateGeometryError:
                return  # a later frame has more edges
            self._misfits = 0
        else:
            moving = {
                place: (one.velocity_y, one.yaw_rate)
                for k, place in number.items()
                if (one := self._motions.get(k)) is not None
            }
            self.filter.predict(moving, dt)
            used = self.filter.bearings(edges, bearings, self._sigma)
            self._misfits = self._misfits + 1 if 2 * used < len(edges) else 0
        for k, (message, _) in frame.items():
            if message.distance > 0.0 and k in number and k + 1 in number:
                pair = number[k], number[k + 1]
                self.filter.distance(*pair, message.distance, DISTANCE_SIGMA)
        if self._misfits > MISFITS:
            self.filter = None

    def _log(self, stamp_ns: int, now_ns: int) -> None:
        assert self.filter is not None
        places, yaws, covariance = self.filter.estimate
        names, index = self._company.names, self._company.index
        others = [place for place, k in enumerate(self.members) if k != index]
        for at, place in enumerate(others):
            out = _layout(names[index]).new()
            set_stamps(out, stamp_ns)
            out["pose.pose.position"] = places[place]
            half = 0.5 * float(yaws[place])
            out["pose.pose.orientation"] = 0.0, 0.0, math.sin(half), math.cos(half)
            out["pose.covariance"] = _of_ros(covariance[4 * at : 4 * at + 4, 4 * at : 4 * at + 4])
            topic = TOPIC + names[self.members[place]]
            self._company.log(topic, TYPE, out.tobytes(), stamp_ns, now_ns)


class Motion:
    """The motion of one vehicle, by the velocities that it is asked to fly.

    Attributes:
        velocity_y: (3,) m/s in its yaw frame. yaw_rate: rad/s.
    """

    def __init__(self) -> None:
        self.velocity_y: Array = np.zeros(3)
        self.yaw_rate = 0.0
        self._poles = np.zeros((3, 3))
        self._before: Message | None = None

    def follow(self, message: Message, velocity_w: Triple) -> None:
        """Follow as late as the reference of the behavior *velocity* does: by three poles."""
        if (before := self._before) is not None:
            dt = 1e-9 * (message.stamp_ns - before.stamp_ns)
            share, wanted = 1.0 - math.exp(-BANDWIDTH * dt), np.array(velocity_w)
            for k in range(len(self._poles)):
                wanted = self._poles[k] = self._poles[k] + share * (wanted - self._poles[k])
            self.yaw_rate = math.remainder(message.yaw - before.yaw, 2.0 * math.pi) / dt
            self.velocity_y = yaw_rotation(-message.yaw) @ wanted
        self._before = message


@cache
def _layout(vehicle: str) -> FixedLayout:
    return FixedLayout(TYPE, {"header.frame_id": f"{vehicle}/yaw"})


def _of_ros(covariance: Array) -> Array:
    """Return the covariance of x, y, z and yaw (4, 4) as ROS has it, (36,), with roll and pitch."""
    out, kept = np.zeros((6, 6)), [0, 1, 2, 5]
    out[np.ix_(kept, kept)] = covariance
    return out.ravel()
