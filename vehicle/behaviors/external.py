"""A behavior of the user's own: its answers are the references of the behavior `external`."""

from __future__ import annotations

import numpy as np

from control.behaviors.behavior import ExternalReference, Joy
from quadrotor.errors import RefusedError
from quadrotor.records import Record
from vehicle.behaviors.contract import BEHAVIOR
from vehicle.plugins.external import External
from vehicle.plugins.links import Link

ANSWER = np.dtype([("time", "<f8"), ("ended", "<f8"), ("reference", "<f8", 18)])
"""OUTPUT_TYPE with the reference as one vector, in the order of REFERENCE's fields."""
STATE = ("position_w", "velocity_w", "quaternion_wb", "angular_velocity_b")
REFERENCE = ("position_w", "velocity_w", "yaw")


class ExternalBehavior(External):
    """A plugin that is asked in each tick of the behavior `external`, and writes its `outside`.

    An answer is a reference of the tick before, whose stamp it gets. Between answers `external`
    continues the last one. A reference that it does not accept, and a plugin that fails, end in
    brake and hover.
    """

    def __init__(self, name: str, link: Link, waits: bool, outside: ExternalReference) -> None:
        super().__init__(BEHAVIOR, name, link, waits)
        self._outside, self._asked_ns = outside, 0

    def begin(self, stamp_ns: int, reference: Record) -> None:
        """Make it begin with the next input, at this reference (1,). Raises RefusedError while it
        cannot.
        """
        if not self.is_ready or self.failure:
            why = self.failure or "it is loading"
            raise RefusedError(f"external refused: behavior {self.name} cannot fly: {why}")
        self._out["reset"] = 1.0
        self._outside.begin()
        self._outside.store(stamp_ns, reference.view("f8").tolist())

    def step(
        self,
        stamp_ns: int,
        dt: float,
        state: Record,
        reference: Record,
        joy: Joy | None,
        joy_timeout: float,
    ) -> None:
        """Take the answer to the last input, and send the next.

        Args:
            reference: of the last tick.
            joy_timeout: age (s) from which sticks count as released.
        """
        try:
            answer = None if self._out["reset"][0] else self._answer()
            if answer is not None:
                self._take(answer)
            out = self._out
            out["time"] += dt
            out["dt"] = dt
            for name in STATE:
                out[name] = state[name]
            for name in REFERENCE:
                out[f"reference_{name}"] = reference[name]
            held = joy is not None and joy[2] and stamp_ns - joy[0] <= 1e9 * joy_timeout
            out["stick"], out["stick_held"] = joy[1] if joy is not None and held else 0.0, held
            self._asked_ns = stamp_ns
            self._ask()
        except RefusedError as error:
            self._outside.failure = self.failure = str(error)

    def _take(self, answer: Record) -> None:
        found = answer.view(ANSWER)
        if found["ended"][0]:
            self._outside.has_ended = True
            return
        numbers = found["reference"][0]
        if not np.isfinite(numbers).all():
            raise RefusedError(f"it answered {numbers.tolist()}, which is not finite")
        self._outside.store(self._asked_ns, numbers.tolist())
