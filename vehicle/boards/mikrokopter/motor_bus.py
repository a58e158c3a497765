"""Checks that all four motor controllers answer on the microcontroller's bus.

They are polled one after the other while the motors are off: with a controller missing the
microcontroller does not start them, and the operator needs to know which plug to check.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from quadrotor.constants import MOTORS
from vehicle_link.clock import monotonic_ns
from vehicle_link.link_counts import LinkCounts
from vehicle_link.serial.commands import encode_request
from vehicle_link.serial.ids import Id

REFERENCES = (
    Id.MOTOR_REFERENCE_1,
    Id.MOTOR_REFERENCE_2,
    Id.MOTOR_REFERENCE_3,
    Id.MOTOR_REFERENCE_4,
)
NO_ANSWER = -1
"""Value reported instead of the reference of a motor whose controller does not answer."""
PERIOD_S = 0.1
"""Period, in s, of the requests: all four are polled every 0.4 s."""


class MotorBus:
    """The motor controllers as reported by the microcontroller.

    Args:
        counts: counts the answers and their round trips.

    Attributes:
        missing: names of the motors whose controllers do not answer; empty before the first poll.
        why: what is wrong and what to try; empty when nothing is missing.
    """

    def __init__(self, counts: LinkCounts | None = None) -> None:
        self._counts, self._asked_ns = counts or LinkCounts(), 0  # 0: no open question
        self.missing: tuple[str, ...] = ()
        self.why = ""
        self._answers = [0, 0, 0, 0]
        self._turn = 0
        self._due_s = -math.inf

    def question(self, now_s: float, command: Sequence[int]) -> bytes | None:
        """Return the frame that is due, with these command bytes, if any."""
        if now_s < self._due_s:
            return None
        self._due_s = now_s + PERIOD_S
        self._turn = (self._turn + 1) % len(MOTORS)
        self._asked_ns = monotonic_ns()
        return encode_request(command, REFERENCES[self._turn])

    def receive(self, id: int, value: object) -> str | None:
        """Handle an answer of the microcontroller; return a line when it changed `missing`."""
        if id not in REFERENCES or not isinstance(value, int):
            return None
        if self._asked_ns:
            self._counts.answered += 1
            self._counts.round_trips_ns += monotonic_ns() - self._asked_ns
            self._asked_ns = 0
        self._answers[REFERENCES.index(Id(id))] = value
        missing = tuple(
            motor
            for motor, answer in zip(MOTORS, self._answers, strict=True)
            if answer == NO_ANSWER
        )
        if missing == self.missing:
            return None
        self.missing, self.why = missing, _no_answer(missing) if missing else ""
        return "microcontroller: " + (self.why or "all motors' controllers answer again")


def _no_answer(motors: Sequence[str]) -> str:
    named = " and ".join(motors)
    one = len(motors) == 1
    return (
        f"no answer from the controller{'' if one else 's'} of motor{'' if one else 's'} {named} "
        "on the motors' bus; check plug and supply"
    )
