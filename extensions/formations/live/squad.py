"""The programs of a formation in real time: one of each vehicle, which meets the others here.

The programs are those of `quadlab fly formation`. They run at the base, but each is given no more
than its vehicle would know: its own attitude, its own bearings, and what the others broadcast. The
bearings are emulated from where the vehicles are, as bearings to beacons are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from console.experiments.together import Neighbour
from extensions.formations.mathematics.steering import NullMotion
from extensions.formations.messages import Whereabouts
from extensions.formations.options import FormationOptions
from extensions.formations.pilot import AS_LATE, Pilot
from extensions.formations.separation import Guard
from extensions.formations.shape import Edge, Shape, shape_of
from quadrotor.plain_rotations import Triple
from quadrotor.records import Array

Quadruple = tuple[float, float, float, float]
Record = Callable[[str, str, bytes, int], None]
RADIUS = 0.377
"""m, of a sphere around the rotors of a vehicle, which hides those behind it."""
OUT_OF_RANGE = (1e6, 1e6, 1e6)
"""m, place of a vehicle of which no place is known: no sensor sees it."""
MEETING_NS, MEETINGS_MAX = 50_000_000, 12
"""Largest time between two meetings, and the number of meetings that are made up for."""
SMOOTH = 0.1
"""Weight of a new bearing in the error of its edge."""
SEEN_NS = 500_000_000
"""Age up to which the bearings of an edge are shown."""


@dataclass(frozen=True, slots=True)
class Pose:
    """The place, motion and attitude of a vehicle.

    Attributes:
        position_w: m. velocity_w: m/s. quaternion_wb: w, x, y, z.
    """

    stamp_ns: int
    position_w: Triple
    velocity_w: Triple = (0.0, 0.0, 0.0)
    quaternion_wb: Quadruple = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Situation:
    """The state of a vehicle, as far as it is known now.

    Attributes:
        pose: where it is, for the sensors of the others; None where it is not known.
        heard: whether its estimate and status arrive, so that its program can take part.
        airborne: whether it flies.
        obeys: whether it flies the velocities that it is sent, and so is part of the formation.
        limits: m/s, of the velocity that full sticks command along x, y and z. yaw_rate: rad/s.
    """

    pose: Pose | None = None
    heard: bool = False
    airborne: bool = False
    obeys: bool = False
    limits: Triple = (1.0, 1.0, 0.5)
    yaw_rate: float = 1.0


class Member:
    """The place of one vehicle among the others: the `Company` of its program."""

    def __init__(
        self, squad: Squad, index: int, event: Callable[[str, str], None], seed: int
    ) -> None:
        self._squad, self.index, self.seed = squad, index, seed
        self._event = event
        self.mail = self.arriving = b""
        self.pose = Pose(0, OUT_OF_RANGE)
        self.calls: list[Callable[[int], None]] = []

    @property
    def names(self) -> Sequence[str]:
        return self._squad.names

    def attitude(self) -> Quadruple:
        """Return its attitude, w, x, y, z."""
        return self.pose.quaternion_wb

    def neighbour(self, index: int) -> Neighbour:
        """Return a vehicle as it was at the last meeting."""
        one = self._squad.members[index]
        pose = one.pose
        motion = pose.position_w, pose.velocity_w, pose.quaternion_wb
        return Neighbour(pose.stamp_ns, *motion, radius=RADIUS, mail=one.arriving)

    def broadcast(self, mail: bytes) -> None:
        """Send bytes, which the others get at the next meeting."""
        self.mail = mail

    def log(self, topic: str, type_name: str, payload: bytes, stamp_ns: int, log_ns: int) -> None:
        """Have a message recorded."""
        self._squad.record(self.names[self.index], topic, payload, stamp_ns)

    def event(self, line: str) -> None:
        """Tell a line of its program."""
        self._event(self.names[self.index], line)

    def at_meetings(self, call: Callable[[int], None]) -> None:
        """Call this at each meeting, with the time in ns."""
        self.calls.append(call)


class Squad:
    """The programs of all vehicles.

    Args:
        names: of all vehicles. event: called with the name of a vehicle, and the line that its
            program tells. seed: of the emulated sensors. record: called with the name of a
            vehicle, topic, payload and stamp (ns) of what its sensor measures.

    Attributes:
        shape: the desired formation.

    Raises UsageError for a formation that cannot be flown.
    """

    def __init__(
        self,
        names: Sequence[str],
        options: FormationOptions,
        event: Callable[[str, str], None],
        seed: int = 1,
        record: Record = lambda *_: None,
    ) -> None:
        self.names, self.options, self.record = tuple(names), options, record
        self.shape: Shape = shape_of(options.desired, len(names))
        self.members = [Member(self, k, event, seed + k) for k in range(len(names))]
        self._pilots = [Pilot(one, options, self.shape) for one in self.members]
        pairs = zip(self.members, self._pilots, strict=True)
        self._guards = [Guard(one, pilot.radio) for one, pilot in pairs]
        self._there, self._airborne = set[int](), set[int]()
        self._turning = [0.0 for _ in names]
        self._errors: dict[Edge, tuple[int, Array]] = {}
        self._now_ns = 0

    @property
    def flying(self) -> list[int]:
        """Return the vehicles that are part of the formation."""
        return [k for k, pilot in enumerate(self._pilots) if pilot.is_flying]

    @property
    def eigenvalue(self) -> float:
        """Return the smallest rigidity eigenvalue that a vehicle of the formation knows of; 0
        without a formation.
        """
        return min((self._pilots[k].eigenvalue for k in self.flying), default=0.0)

    @property
    def errors(self) -> dict[Edge, float]:
        """Return the error, deg, of the smoothed bearing of each edge that is seen."""
        return {
            edge: math.degrees(2.0 * math.asin(min(1.0, 0.5 * float(np.linalg.norm(mean)))))
            for edge, (stamp_ns, mean) in self._errors.items()
            if self._now_ns - stamp_ns <= SEEN_NS
        }

    def step(
        self, now_ns: int, situations: Sequence[Situation], command: NullMotion
    ) -> dict[int, Quadruple]:
        """Let all programs meet; return the sticks of each vehicle of the formation: forward, left,
        up and yaw in -1 to 1.

        It is called at 50 Hz or so. A vehicle that is not part of the formation says where it is,
        for the separation alone. One that was never heard, or was on the ground when it was heard
        last, is not there; one that is not heard any more in the air is silent.
        """
        before_ns, before = self._now_ns, [one.pose for one in self.members]
        count = math.ceil((now_ns - before_ns) / MEETING_NS)
        # A busy computer calls late; between two calls the vehicles have met all the same.
        for part in range(1, count if count <= MEETINGS_MAX else 1):
            share = part / count
            between = [
                replace(one, pose=_between(pose, one.pose, share))
                for pose, one in zip(before, situations, strict=True)
            ]
            self._meet(before_ns + round(share * (now_ns - before_ns)), between, command)
        self._meet(now_ns, situations, command)
        return {k: self._sticks(k, situations[k], now_ns) for k in self.flying}

    def _meet(self, now_ns: int, situations: Sequence[Situation], command: NullMotion) -> None:
        self._now_ns = now_ns
        for k, one in enumerate(situations):
            self._note(k, one, now_ns)
        absent = set(range(len(self.names))) - self._there
        for member, pilot in zip(self.members, self._pilots, strict=True):
            member.arriving, member.mail = member.mail, b""
            pilot.command, pilot.radio.absent = command, absent
        for k, one in enumerate(situations):
            if one.heard:
                for call in self.members[k].calls:
                    call(now_ns)
                self._note_errors(k)

    def _note(self, k: int, situation: Situation, now_ns: int) -> None:
        pilot, pose = self._pilots[k], situation.pose
        self.members[k].pose = pose or Pose(0, OUT_OF_RANGE)
        pilot.is_flying = situation.heard and situation.obeys and pose is not None
        pilot.radio.has_left = not pilot.is_flying
        if situation.heard and pose is not None and not pilot.is_flying:
            pilot.radio.own = Whereabouts(now_ns, pose.position_w, pose.velocity_w)
        if situation.heard:
            self._there.add(k)
            (self._airborne.add if situation.airborne else self._airborne.discard)(k)
        elif k not in self._airborne:
            self._there.discard(k)

    def _sticks(self, k: int, situation: Situation, now_ns: int) -> Quadruple:
        pilot, limits = self._pilots[k], np.array(situation.limits)
        here = self.members[k].pose.position_w
        asked, commanded = pilot.velocity_y, pilot.commanded_y
        kept = self._guards[k].keep(asked, here, now_ns, limits, commanded)
        u, v, w = (kept / limits).tolist()
        self._turning[k] += AS_LATE * (pilot.yaw_rate - self._turning[k])
        return u, v, w, max(-1.0, min(1.0, self._turning[k] / situation.yaw_rate))

    def _note_errors(self, k: int) -> None:
        """Note how far the newest bearings of a vehicle are from the desired ones."""
        sent = self._pilots[k].radio.sent
        for j, bearing_y in (sent.bearings_y if sent else {}).items():
            assert sent is not None
            stamp_ns, mean = self._errors.get((k, j), (0, np.zeros(3)))
            wanted = self.shape.desired.get((k, j))
            if wanted is None or stamp_ns == sent.stamp_ns:
                continue
            error = np.asarray(bearing_y) - np.asarray(wanted)
            is_new = sent.stamp_ns - stamp_ns > SEEN_NS
            mean = error if is_new else mean + SMOOTH * (error - mean)
            self._errors[k, j] = sent.stamp_ns, mean


def _between(one: Pose, other: Pose | None, share: float) -> Pose | None:
    """Return the pose at a share of the way; the other one where there is no way."""
    if other is None or one.stamp_ns == 0 or other.stamp_ns <= one.stamp_ns:
        return other

    def mixed(a: Sequence[float], b: Sequence[float]) -> list[float]:
        return [(1.0 - share) * p + share * q for p, q in zip(a, b, strict=True)]

    x, y, z = mixed(one.position_w, other.position_w)
    u, v, w = mixed(one.velocity_w, other.velocity_w)
    a, b = one.quaternion_wb, other.quaternion_wb
    sign = math.copysign(1.0, sum(p * q for p, q in zip(a, b, strict=True)))
    q = mixed([sign * p for p in a], b)
    length = math.hypot(*q)
    stamp_ns = one.stamp_ns + round(share * (other.stamp_ns - one.stamp_ns))
    turned = q[0] / length, q[1] / length, q[2] / length, q[3] / length
    return Pose(stamp_ns, (x, y, z), (u, v, w), turned)
