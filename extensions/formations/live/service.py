"""The formation of the vehicles of one page: what is known of them, who steers, and its loop."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from extensions.formations.live.squad import Pose, Situation, Squad
from extensions.formations.mathematics.steering import NullMotion
from extensions.formations.options import FormationOptions
from extensions.formations.pilot import STEP
from quadrotor.errors import LinkError, UsageError
from quadrotor.plain_rotations import rotate
from vehicle_link.clock import time_ns
from vehicle_link.messages.records import Odometry
from web.commands.sticks import SILENCE

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext

TOPICS = frozenset({"state", "truth"})
AT_LEAST = 3
"""Number of vehicles that make a formation."""
TOLD = 5
"""Number of lines of the programs that are kept for people."""
RISE = 0.5
"""s in which what is flown rises from zero after a press, as a deflected stick at a press counts
for nothing."""


@dataclass
class Hand:
    """The dead-man button of one page, and the sticks below it.

    Attributes:
        label: who steers. axes: forward, left, up, turn, grow, in -1 to 1. at: s, monotonic, of
            the newest frame. since: of the press.
        dropped: called with the reason when the vehicles are not steered any more.
    """

    label: str
    dropped: Callable[[str], None]
    axes: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    at: float = -math.inf
    since: float = -math.inf


class Formations:
    """The formation of all vehicles of one page; all methods are for the event loop's thread.

    Attributes:
        options: of the formation. lines: newest lines that the programs have told, oldest first.
    """

    def __init__(self) -> None:
        self.options = FormationOptions()
        self.lines: list[str] = []
        self._contexts: list[VehicleContext] = []
        self._squad: Squad | None = None
        self._hand: Hand | None = None
        self._steered: set[str] = set()
        self._watchers = 0
        self._loop: asyncio.Task[None] | None = None

    def add(self, context: VehicleContext) -> None:
        """Add a vehicle, before any is served."""
        self._contexts.append(context)

    @property
    def holder(self) -> str:
        """Return who steers; "" for nobody."""
        return "" if self._hand is None else self._hand.label

    @property
    def names(self) -> list[str]:
        return [one.vehicle for one in self._contexts]

    @property
    def squad(self) -> Squad:
        """Return the programs. Raises UsageError for too few vehicles."""
        if len(self._contexts) < AT_LEAST:
            raise UsageError(
                f"{len(self._contexts)} of at least {AT_LEAST} vehicles: start quadlab up "
                f"--vehicles {AT_LEAST}"
            )
        if self._squad is None:
            self._squad = Squad(self.names, self.options, self._tell, record=self._record)
        return self._squad

    def change(self, options: FormationOptions) -> None:
        """Take other options. Raises UsageError, also while the formation is steered."""
        if self._hand is not None:
            raise UsageError(f"{self._hand.label} steers the formation: release its sticks first")
        if len(self._contexts) >= AT_LEAST:
            self._squad = Squad(self.names, options, self._tell, record=self._record)
        self.options = options

    # ------------------------------------------------------------------ people
    def refusal(self, label: str) -> str:
        """Return why a person may not steer now, or ""."""
        if self._hand is not None:
            return f"{self._hand.label} steers the formation"
        if len(self.squad.flying) < AT_LEAST:
            return f"{len(self.squad.flying)} of at least {AT_LEAST} vehicles fly velocity"
        for k in self.squad.flying:
            context = self._contexts[k]
            if not context.control.may(label):
                return f"{context.control.holder} has control of {context.vehicle}"
        return ""

    def steer(self, hand: Hand) -> None:
        """Let a page steer, which `refusal` permits, until `release`."""
        self._hand = hand

    def release(self, hand: Hand, why: str = "") -> None:
        """Stop all vehicles where they are, if this page steers them."""
        if self._hand is not hand:
            return
        self._hand = None
        for context in self._contexts:
            context.stick.release(self)
        self._steered.clear()
        if why:
            hand.dropped(why)
            self._contexts[0].hub.say("warn", f"the formation of {hand.label} stopped: {why}")

    # ------------------------------------------------------------------ its loop
    @contextlib.contextmanager
    def watched(self) -> Iterator[None]:
        """Run the programs while a page is open. Raises UsageError for too few vehicles."""
        _ = self.squad
        self._watchers += 1
        for context in self._contexts:
            context.wanted |= TOPICS
        if self._loop is None:
            self._loop = asyncio.create_task(self._run())
            self._loop.add_done_callback(self._ended)
        try:
            yield
        finally:
            self._watchers -= 1
            if self._watchers == 0:
                self._rest()

    def _rest(self) -> None:
        if self._loop is not None:
            self._loop.cancel()
        self._loop, self._squad = None, None
        for context in self._contexts:
            context.wanted -= TOPICS

    def _ended(self, loop: asyncio.Task[None]) -> None:
        """Stop the vehicles and report a loop that ended with an error, which is a defect."""
        if loop.cancelled() or (error := loop.exception()) is None:
            return
        why = f"its programs ended with an error ({error}); reload the page of the fleet"
        if self._hand is not None:
            self.release(self._hand, why)
        else:
            self._contexts[0].hub.say("error", f"the formation stopped: {why}")
        self._loop = None
        logging.getLogger("quadlab.web").error("the formation stopped", exc_info=error)

    async def _run(self) -> None:
        while True:
            began = time.monotonic()
            self._step(began)
            await asyncio.sleep(max(0.001, began + STEP - time.monotonic()))

    def _step(self, now: float) -> None:
        hand = self._hand
        if hand is not None and now - hand.at > SILENCE:
            self.release(hand, f"the page was silent for {now - hand.at:.2f} s")
            hand = None
        sticks = self.squad.step(
            time_ns(), [situation_of(one) for one in self._contexts], self._motion(hand)
        )
        if hand is None:
            return
        for k, context in enumerate(self._contexts):
            if self._hand is not hand:
                return  # a vehicle before this one has stopped all
            if k in sticks:
                self._send(context, sticks[k], hand)
            elif context.vehicle in self._steered:
                self._steered.discard(context.vehicle)
                context.stick.release(self)
        if not self._steered:
            self.release(hand, "no vehicle obeys the sticks any more")

    def _send(self, context: VehicleContext, axes: tuple[float, ...], hand: Hand) -> None:
        rise = min(1.0, (hand.at - hand.since) / RISE)
        u, v, w, r = (rise * one for one in axes)
        if context.vehicle not in self._steered:  # the station wants to see a release first
            context.stick.release(self, hand.label)
        answered = partial(self._answered, hand, context.vehicle)
        if context.stick.send(self, (u, v, w, r), hand.label, answered):
            self._steered.add(context.vehicle)
        else:
            self.release(hand, f"another page has the sticks of {context.vehicle}")

    def _answered(self, hand: Hand, vehicle: str, on: bool, why: str) -> None:
        if not on and vehicle in self._steered:
            self.release(hand, f"{vehicle}: {why or 'its sticks were released'}")

    def _motion(self, hand: Hand | None) -> NullMotion:
        if hand is None:
            return NullMotion()
        p, (forward, left, up, turn, grow) = self.options, hand.axes
        velocity = (p.speed * forward, p.speed * left, p.speed * up)
        return NullMotion(velocity, p.yaw_rate * turn, p.scale_rate * grow)

    def _of(self, vehicle: str) -> VehicleContext:
        return next(one for one in self._contexts if one.vehicle == vehicle)

    def _record(self, vehicle: str, topic: str, payload: bytes, stamp_ns: int) -> None:
        """Have the station record what the sensor of a vehicle measures."""
        with contextlib.suppress(LinkError):  # the session was closed first
            self._of(vehicle).station.publish(topic, payload, stamp_ns)

    def _tell(self, vehicle: str, line: str) -> None:
        """Keep a line, and tell it to the pages of the vehicle whose program tells it."""
        self._of(vehicle).hub.say("warn", line)
        if line in self.lines:
            self.lines.remove(line)
        self.lines = [*self.lines, line][-TOLD:]


def situation_of(context: VehicleContext) -> Situation:
    """Return the present state of a vehicle, as far as it is known."""
    live, value = context.live, context.replica.value
    state, status = live.current("state"), live.current("status")
    truth = live.current("truth")
    seen, topic = (state, "state") if truth is None else (truth, "truth")
    pose = None if seen is None else pose_of(seen, time_ns() - round(1e9 * live.age(topic)))
    if state is None or status is None:
        return Situation(pose)
    xy, z, yaw_rate = (
        float(value(f"behavior.joy_{name}") or usual)
        for name, usual in (("speed_xy", 1.0), ("speed_z", 0.5), ("yaw_rate", 1.0))
    )
    obeys = bool(status.airborne) and str(status.behavior) == "velocity"
    return Situation(pose, True, bool(status.airborne), obeys, (xy, xy, z), yaw_rate)


def pose_of(message: Odometry, stamp_ns: int) -> Pose:
    """Return the pose of a message that arrived at `stamp_ns`."""
    position, q = message.pose.pose.position, message.pose.pose.orientation
    quaternion_wb = float(q.w), float(q.x), float(q.y), float(q.z)
    v = message.twist.twist.linear
    x, y, z = rotate(quaternion_wb, (v.x, v.y, v.z))
    place = float(position.x), float(position.y), float(position.z)
    return Pose(stamp_ns, place, (float(x), float(y), float(z)), quaternion_wb)
