"""The health of the poses of each body: what is wrong, and which poses must not be flown on.

A pose with a doubtful meaning (unit, axes, which body) is withheld, never corrected by a guess: the
vehicle then behaves as without poses. A jump without such an explanation is passed on and reported:
estimator and supervisor on board judge it.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import Literal

import numpy as np

from console.trackers.source import Body
from quadrotor.plain_rotations import Array, matrix_of

Unit = Literal["m", "mm"]
Up = Literal["z", "y"]

FARTHEST = 50.0
"""Largest distance in m from the origin; no laboratory is larger, and millimetres soon
exceed it."""
LOWEST = -0.5
"""Lowest height in m; the floor of a laboratory is at 0."""
FORGOTTEN = 2.0
"""Seconds without being seen after which a body's past is ignored."""
SPEED, STEP = 10.0, 0.1
"""Largest motion of a body of unknown velocity between two frames: SPEED (m/s) and STEP (m). …"""
ACCELERATION, BASE = 30.0, 0.1
"""… With a known velocity over the last BASE (s) it is ACCELERATION (m/s²), …"""
TURN_RATE, TURN = 20.0, math.radians(45)
"""… and the largest turn is TURN_RATE (rad/s) and TURN (rad)."""
FROZEN = 0.1
"""Speed in m/s above which a pose does not repeat itself."""
LIKE = 0.1
"""Largest distance in m between a position and one that would explain it."""
ON_ITS_SIDE = math.radians(60)
SETTLED = 0.5
"""Seconds without moving by STEP before a body's attitude is judged."""
NOTED = 1.0
"""Seconds for which a past jump is reported."""

_AXES = ("x", "y", "z")
_WRONG: Mapping[str, Array] = {
    "mirrored along x": np.diag([-1.0, 1.0, 1.0]),
    "mirrored along y": np.diag([1.0, -1.0, 1.0]),
    "mirrored along z": np.diag([1.0, 1.0, -1.0]),
    "turned by 180° about z": np.diag([-1.0, -1.0, 1.0]),
    "turned by 90° about z": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "turned by −90° about z": np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "y-up": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "z-up and were y-up": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
"""Matrices from correct to wrong positions, by the error."""


class BodyHealth:
    """Judges one body's poses, in the axes and the unit that the user specified.

    Attributes:
        jumps: number since the start.
        withheld: why its newest pose must not be flown on; "" when it may.
    """

    def __init__(self) -> None:
        self.jumps = 0
        self.withheld = ""
        self._last: Body | None = None
        self._at = self._seen = self._still_since = -math.inf
        self._rest: Array | None = None
        self._track: deque[tuple[float, Array]] = deque()  # of the last BASE, without a jump
        self._moved = ""  # the jump that made the positions wrong
        self._turn = np.eye(3)  # product of all jumps of the attitude, in body axes
        self._note, self._noted = "", -math.inf

    def problem(self, now: float) -> str:
        """Return what is wrong, or was until just now; else ""."""
        return self.withheld or (self._note if now - self._noted < NOTED else "")

    def judge(self, body: Body, now: float, others: Mapping[str, Array]) -> bool:
        """Judge a pose and return whether it may be flown on.

        Args:
            now: its time, s, steady.
            others: positions of the other bodies in the previous frame, m.
        """
        if now - self._seen > FORGOTTEN:
            self._last, self._moved, self._turn, self._rest = None, "", np.eye(3), None
            self._track.clear()
        self.withheld = _invalid(body)
        if not self.withheld:
            self._seen = now
            if not self._is_frozen(body):  # then nothing is known of the motion
                if self._last is not None:
                    self._compare(self._last, body, now, others)
                self._last, self._at = body, now
                self._track.append((now, body.position_w))
                while now - self._track[0][0] > BASE:
                    self._track.popleft()
            self.withheld = self._moved or self._flipped(body) or self._lying(body, now)
        return not self.withheld

    def _compare(self, last: Body, body: Body, now: float, others: Mapping[str, Array]) -> None:
        past = max(0.0, now - self._at)
        velocity = self._velocity()
        expected = last.position_w if velocity is None else last.position_w + velocity * past
        far = float(np.linalg.norm(body.position_w - expected))
        if far > STEP + past * (SPEED if velocity is None else ACCELERATION * (BASE + past)):
            self._track.clear()
            # A jump after an implausible jump is taken for the return.
            self._moved = "" if self._moved else _explained(expected, body, others)
            self._jumped(f"{body.name} jumped by {far:.2f} m from one frame to the next", now)
        if last.quaternion_wb is not None and body.quaternion_wb is not None:
            turn = matrix_of(last.quaternion_wb).T @ matrix_of(body.quaternion_wb)
            if (angle := _angle(turn)) > TURN + TURN_RATE * past:
                self._turn = self._turn @ turn
                self._jumped(f"{body.name} turned by {math.degrees(angle):.0f}° at once", now)

    def _is_frozen(self, body: Body) -> bool:
        """Return whether a body that was moving has the same pose again, to the last bit."""
        last, velocity = self._last, self._velocity()
        return (
            last is not None
            and velocity is not None
            and float(np.linalg.norm(velocity)) > FROZEN
            and np.array_equal(last.position_w, body.position_w)
            and np.array_equal(last.quaternion_wb, body.quaternion_wb)  # type: ignore[arg-type]
        )

    def _velocity(self) -> Array | None:
        """Return the velocity over the last BASE, (3,) m/s, or None when too little is known."""
        if not self._track or self._track[-1][0] - self._track[0][0] < 0.5 * BASE:
            return None
        (begin, first), (end, newest) = self._track[0], self._track[-1]
        return (newest - first) / (end - begin)

    def _jumped(self, note: str, now: float) -> None:
        self.jumps += 1
        self._note, self._noted = note, now

    def _flipped(self, body: Body) -> str:
        if (angle := _angle(self._turn)) < TURN:
            return ""
        by = 5 * round(math.degrees(angle) / 5)
        return (
            f"{body.name}'s axes have flipped by {by}° from one frame to the next: make "
            "its markers less symmetric and define the body again"
        )

    def _lying(self, body: Body, now: float) -> str:
        """Return what is wrong with the attitude of a body that does not move."""
        if self._rest is None or np.linalg.norm(body.position_w - self._rest) > STEP:
            self._rest, self._still_since = body.position_w, now
        if body.quaternion_wb is None or now - self._still_since < SETTLED:
            return ""
        up = matrix_of(body.quaternion_wb)[:, 2]
        if math.acos(min(1.0, max(-1.0, float(up[2])))) < ON_ITS_SIDE:
            return ""
        axis = int(np.argmax(np.abs(up)))
        along = f"{'+' if up[axis] > 0 else '−'}{_AXES[axis]}"
        return (
            f"{body.name} lies still with its z axis along the world's {along}: stand it upright; "
            "if it is, the system is y-up (--up y), or the body's axes are turned in it"
        )


def _invalid(body: Body) -> str:
    """Return why a pose is unusable by itself; "" when it is usable."""
    place, turn = body.position_w, body.quaternion_wb
    if not np.isfinite(place).all():
        return f"{body.name} has a position that is not finite: {place.tolist()}"
    if (far := float(np.linalg.norm(place))) > FARTHEST:
        return (
            f"{body.name} is {far:.0f} m from the origin: the system seems to send millimetres; "
            "let it send metres, or start the tracker with --unit mm"
        )
    if place[2] < LOWEST:
        return (
            f"{body.name} is {-place[2]:.1f} m below the floor: the system seems to be y-up; let "
            "its z axis point up, or start the tracker with --up y"
        )
    if turn is not None and not abs(float(np.linalg.norm(turn)) - 1.0) < 0.05:
        return (
            f"{body.name} comes with the quaternion (w, x, y, z) {turn.tolist()}, which is not "
            "of unit length; check the order of the fields"
        )
    return ""


def _explained(expected: Array, body: Body, others: Mapping[str, Array]) -> str:
    """Return the error of names or axes that explains a jump; "" when none does."""
    for name, place in others.items():
        if np.linalg.norm(body.position_w - place) < LIKE:
            return (
                f"{body.name} and {name} have changed places from one frame to the next: the "
                "system takes one for the other; make their markers differ more"
            )
    for how, wrong in _WRONG.items():
        if np.linalg.norm(wrong @ expected - body.position_w) < LIKE:
            return f"{body.name}'s positions have become {how}: set the system's axes back"
    return ""


def _angle(turn: Array) -> float:
    return math.acos(min(1.0, max(-1.0, 0.5 * (float(np.trace(turn)) - 1.0))))


def to_world(body: Body, unit: Unit, up: Up) -> Body:
    """Return a body of a system with this unit and upward axis in m, z up.

    In a y-up system x stays x, y becomes z, and z becomes −y, in the world and in the body.
    """
    place, turn = body.position_w, body.quaternion_wb
    if unit == "mm":
        place = 1e-3 * place
    if up == "y":
        place = np.array([place[0], -place[2], place[1]])
        if turn is not None:
            turn = np.array([turn[0], turn[1], -turn[3], turn[2]])
    return Body(body.name, place, turn)
