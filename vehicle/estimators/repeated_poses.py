"""Detection of a tracker that repeats its last pose with new stamps.

A pose that equals the one before to the last bit is no measurement: no body in flight is so still.
Dropped, it counts as missing, and the supervisor reacts as to a tracker that is silent. Of a
tracker with coarse numbers, position or attitude alone may repeat for some frames: they count as
frozen once the vehicle has moved meanwhile, or when they last for too long.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from quadrotor.records import NO_ATTITUDE, Array, Record
from vehicle import mailbox

TOLD_NS = 100_000_000
"""Time, in ns, for which a whole pose repeats until it is reported, and a part of it until the
vehicle's motion counts."""
LONGEST_NS = 500_000_000
"""Time, in ns, after which a part that repeats is frozen whatever the vehicle does."""
SPEED, TURN_RATE = 0.1, 0.2
"""Estimated motion, in m/s and rad/s, with which position and attitude do not repeat."""

Part = Literal["pose", "position", "attitude"]


class RepeatedPoses:
    """Judge of the poses of one vehicle.

    Args:
        say: takes a line for the log and its level.
    """

    def __init__(self, say: Callable[[str, int], None]) -> None:
        self._say = say
        self._position = self._quaternion = np.full(0, np.nan)
        self._moved_ns = self._turned_ns = 0  # stamps of the newest change of each
        self._told: Part | None = None

    def takes(self, sample: Record, state: Record, airborne: bool) -> bool:
        """Return whether a POSE_SAMPLE (1,) is a measurement.

        Args:
            state: STATE (1,), as estimated.
            airborne: on the ground a pose may repeat.
        """
        stamp_ns, position, quaternion = sample[0].item()[0], *_parts(sample)
        moved = not np.array_equal(position, self._position)
        turned = not np.array_equal(quaternion, self._quaternion)
        self._position, self._quaternion = position, quaternion
        if moved or not airborne:
            self._moved_ns = stamp_ns
        if turned or not airborne:
            self._turned_ns = stamp_ns
        if not airborne or (moved and turned):
            self._note(None)
            return True
        still_ns, unturned_ns = stamp_ns - self._moved_ns, stamp_ns - self._turned_ns
        if not (moved or turned):
            if min(still_ns, unturned_ns) >= TOLD_NS:
                self._note("pose")
            return False
        has_attitude = bool(np.any(quaternion != NO_ATTITUDE))
        if not moved and _frozen(still_ns, state["velocity_w"][0], SPEED):
            self._note("position")
            return False
        rate = state["angular_velocity_b"][0]
        if not turned and has_attitude and _frozen(unturned_ns, rate, TURN_RATE):
            self._note("attitude")
            return False
        self._note(None)
        return True

    def _note(self, part: Part | None) -> None:
        if part == self._told:
            return
        if part is None:
            self._say(f"the tracker's {self._told} changes again", mailbox.INFO)
        else:
            line = (
                f"the tracker repeats its last {part} with new stamps: its poses count as missing"
            )
            self._say(line, mailbox.WARN)
        self._told = part


def _parts(sample: Record) -> tuple[Array, Array]:
    return sample["position_w"][0].copy(), sample["quaternion_wb"][0].copy()


def _frozen(lasting_ns: int, motion: Array, least: float) -> bool:
    """Return whether a part that has repeated for this time does not follow the motion (3,)."""
    if lasting_ns < TOLD_NS:
        return False
    return lasting_ns >= LONGEST_NS or float(np.linalg.norm(motion)) > least
