"""The flight of a mission: one behavior after the other."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from extensions.mavlink.dialect import MAVLink_message, mavlink
from extensions.mavlink.frames import Vector
from extensions.mavlink.mission_steps import Step
from extensions.mavlink.vehicle import Vehicle

SEEN_WITHIN = 2.0
"""Seconds after its acceptance in which the status must show a behavior."""
REACHED = 0.25
"""Distance, in m, at which a way-point counts as reached."""
ENDS = {"take_off": "hover", "follow_trajectory": "hover", "land": "ground"}
"""The behavior that follows each one when it has ended well."""


class MissionFlight:
    """A mission that is being flown, one behavior after the other.

    Args:
        ask: (behavior, arguments, then) asks the vehicle; `then` gets the reason of a refusal, ""
            if there is none.
        tell: sends all ground stations a message.
        say: tells the one that flies it a line.
    """

    def __init__(
        self,
        who: str,
        steps: Sequence[Step],
        vehicle: Vehicle,
        ask: Callable[[str, dict[str, object], Callable[[str], None]], None],
        tell: Callable[[MAVLink_message], None],
        say: Callable[[str], None],
    ) -> None:
        self.who, self._steps, self._vehicle = who, list(steps), vehicle
        self._ask, self._tell, self._say = ask, tell, say
        self._is_asked = self._is_seen = False
        self._accepted: float | None = None
        self._left: dict[int, Vector] = {}
        self.is_over = False

    def begin(self, then: Callable[[str], None]) -> None:
        """Start the first step; `then` gets the reason of a refusal, or ""."""

        def begun(reason: str) -> None:
            self.is_over = bool(reason)
            then(reason)

        self._start(begun)

    def tick(self, now: float) -> None:
        """Look at the vehicle's state, and start the next step when a step has ended."""
        if self.is_over or not self._is_asked:
            return
        if self._accepted is None:
            self._accepted = now
        step, behavior = self._steps[0], self._vehicle.behavior
        if behavior == step.behavior:
            self._is_seen = True
            self._note_reached()
        elif self._is_seen and behavior == ENDS[step.behavior]:
            self._note_reached(everything=True)
            self._steps.pop(0)
            if not self._steps:
                self.end("mission flown")
            else:
                self._start(self._go_on)
        elif self._is_seen or now - self._accepted > SEEN_WITHIN:
            self.end(f"mission ended: the vehicle does {behavior or 'not answer'}")

    def end(self, line: str) -> None:
        """End it where it is: the present behavior is flown to its end."""
        if not self.is_over:
            self.is_over = True
            self._say(line)

    def _start(self, then: Callable[[str], None]) -> None:
        step = self._steps[0]
        self._is_asked = self._is_seen = False

        def answered(reason: str) -> None:
            self._is_asked, self._accepted = not reason, None
            self._left = dict(step.points)
            self._tell_current()
            then(reason)

        self._ask(step.behavior, step.arguments, answered)

    def _go_on(self, reason: str) -> None:
        if reason:
            self.end(f"mission ended: {reason}")

    def _note_reached(self, everything: bool = False) -> None:
        motion = self._vehicle.motion
        for seq, point in list(self._left.items()):
            is_near = motion is not None and math.dist(point, motion.position_w) < REACHED
            if not (everything or (is_near and self._steps[0].behavior == "follow_trajectory")):
                return
            del self._left[seq]
            self._tell(mavlink.MAVLink_mission_item_reached_message(seq))
            self._tell_current()

    def _tell_current(self) -> None:
        if self._left:
            self._tell(mavlink.MAVLink_mission_current_message(next(iter(self._left))))
