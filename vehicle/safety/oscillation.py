"""Judgement of a flight from every tick: whether it oscillates, or is far from its reference.

A swing is the way between two turning points of the tracking error or of the body rates. Swings
that go on in alternating directions, as long as each other and growing, are an oscillation as soon
as one exceeds the limit; swings of the same size are one after two periods. What decays, as the
answer to a gust or to a step does, is none. The limit follows the swings of the flight so far, so
that rough air is not mistaken for gains that are too high. It is higher while there is hardly a
past: at the beginning, and when the reference begins to move.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from quadrotor.compiled import compiled, direct
from quadrotor.records import Array, Item, Record
from quadrotor.rotations import norm
from vehicle import mailbox
from vehicle.modes import Flag

CHANNELS = ("x", "y", "z", "roll", "pitch", "yaw")
"""Tracking errors along the world's axes, m, and body rates about the body's, rad/s."""
OFF = len(CHANNELS)
"""Number of what is no oscillation, but too far from the reference."""
LEAST = np.array([0.02, 0.02, 0.02, 1.0, 1.0, 0.5])
"""Least size of a swing, from its middle, that counts."""
SURE = np.array([0.03, 0.03, 0.03, 1.0, 1.0, 0.5])
"""The same where four growing or five equal swings are enough."""
LONGEST = np.array([2.0, 2.0, 2.0, 0.25, 0.25, 1.0])
"""Longest duration of a swing, s: what is slower is no oscillation of this loop."""
REGULAR = 1.3
"""Ratio of the longest to the shortest of four swings that grow to a fifth, smaller one."""
OF_PAST = 2.5
"""Multiple of the usual swing of the flight so far that counts."""
PAST = 20.0
"""Time constant, s, of the usual swing, which begins with a plain mean."""
NEW, LEARNT = 2.0, 15.0
"""Multiple of the limit for this time, s, in which the flight has hardly a past."""
MOVES, RESTED = 0.1, 2.0
"""Speed of the reference, m/s, from which it moves, and the time, s, after which it begins to."""
SEEN = 0.4
"""Share of the limit that is the smallest way between two turning points."""
TURNED = 0.3
"""Share of a larger swing that is."""
GROWS = 1.1
"""Ratio of two swings of a body rate from which they grow; its square is that of the tracking error
to the swing before the last one, while each of four is larger than the one before."""
ALIKE = np.array([1.7, 1.7, 1.7, 1.7, 1.7, 2.0])
"""Ratio of two durations, or of two sizes, up to which swings are alike: an oscillating yaw is
slower where the reference turns the other way."""
KEPT = 4
"""Number of complete swings that are kept, and that have to be alike where none grows."""
OVER = 3.0
"""Time, s, without such a swing after which an oscillation is over."""
FAR, FAR_FOR = 0.25, 0.5
"""Distance from the reference, m, and the time, s, for which it is too far."""

WATCH = np.dtype(
    [
        ("now", "f8"),  # s since the beginning
        ("moved_at", "f8"),  # s, when the reference moved last
        ("new_until", "f8"),  # s, until which its motion is new
        ("turn", "f8", 6),  # the newest turning point
        ("turn_at", "f8", 6),  # s
        ("far", "f8", 6),  # the farthest value from it
        ("far_at", "f8", 6),  # s
        ("way", "f8", 6),  # direction since the turning point: 1 up, -1 down, 0 unknown
        ("size", "f8", (6, KEPT)),  # of the newest complete swings, newest first
        ("lasted", "f8", (6, KEPT)),  # s
        ("usual", "f8", 6),  # size of a swing of the flight so far
        ("heard", "f8", 6),  # s of swings in that
        ("distance", "f8"),  # m, from the reference
        ("far_for", "f8"),  # s for which it has been too far
        ("frequency", "f8"),  # Hz, of the oscillation found
        ("until", "f8"),  # s, when it counts as over
        ("channel", "i8"),  # in which it is, -1 for none
    ],
    align=True,
)


@compiled(inner=True)
def _are_alike(k: int, one: float, other: float) -> bool:
    return bool(one < ALIKE[k] * other and other < ALIKE[k] * one)


@compiled(inner=True)
def _grow(m: Item, k: int, size: float, sure: float) -> bool:
    """Return whether the newest swings of channel k, and one of this size, grow."""
    before, second, third = m.size[k, 0], m.size[k, 1], m.size[k, 2]
    if k < 3:  # a single gust makes two swings of the position grow
        is_sure = size > sure or (
            third > m.size[k, 3] and m.lasted[k].max() < REGULAR * m.lasted[k].min()
        )
        return bool(is_sure and size > before > second > third and size > GROWS * GROWS * second)
    return bool(size > GROWS * before and before > GROWS * second)


@compiled(inner=True)
def _limit(m: Item, k: int, least: float) -> float:
    """Return the size from which a swing of channel k counts, at least `least`."""
    usual = float(OF_PAST * m.usual[k])
    if m.now < LEARNT:
        return max(NEW * least, usual)
    return max(least, usual) * (NEW if k < 3 and m.now < m.new_until else 1.0)


@compiled(inner=True)
def _goes_on(m: Item, k: int, size: float, lasts: float) -> bool:
    """Return whether a swing that counts continues an oscillation in channel k."""
    sizes, lasted = m.size[k], m.lasted[k]
    if not (lasts < ALIKE[k] * lasted[0] and m.now - m.turn_at[k] < 2.0 * LONGEST[k]):
        return False
    if m.channel == k:
        return True
    sure = _limit(m, k, float(SURE[k]))
    pair = _are_alike(k, lasted[0], lasted[1]) and max(lasted[0], lasted[1]) < LONGEST[k]
    if pair and _grow(m, k, size, sure):
        return True
    for j in range(KEPT):
        steady = sizes[j] > sure and _are_alike(k, sizes[j], size)
        if not (steady and lasted[j] < LONGEST[k] and _are_alike(k, lasted[j], lasted[0])):
            return False
    return True


@compiled(inner=True)
def _note_motion(m: Item, velocity_w: Array) -> None:
    """Note whether the reference moves, and since when."""
    if norm(velocity_w) > MOVES:
        if m.now - m.moved_at > RESTED:
            m.new_until = m.now + LEARNT
        m.moved_at = m.now


@compiled(inner=True)
def _turn(m: Item, k: int, value: float, size: float, lasts: float, limit: float) -> None:
    """Keep a swing of channel k that is complete, and begin the next one."""
    for j in range(KEPT - 1, 0, -1):
        m.size[k, j], m.lasted[k, j] = m.size[k, j - 1], m.lasted[k, j - 1]
    m.size[k, 0], m.lasted[k, 0] = size, lasts
    if m.channel < 0:
        m.heard[k] += lasts
        share = 1.0 - math.exp(-lasts / min(PAST, m.heard[k] + 1.0))
        m.usual[k] += share * (min(size, limit) - m.usual[k])
    m.way[k], m.turn[k], m.turn_at[k] = -m.way[k], m.far[k], m.far_at[k]
    m.far[k], m.far_at[k] = value, m.now


@compiled
def watch(state: Record, reference: Record, memory: Record, dt: float) -> int:
    """Judge one tick from STATE and REFERENCE (1,).

    Returns the channel that oscillates, OFF where the vehicle is too far from its reference, or -1.
    """
    m, s, r = memory[0], state[0], reference[0]
    m.now += dt
    _note_motion(m, r.velocity_w)
    square = 0.0
    for k in range(6):
        if k < 3:
            value = s.position_w[k] - r.position_w[k]
            square += value * value
        else:
            value = s.angular_velocity_b[k - 3]
        if not math.isfinite(value):
            continue
        if m.way[k] == 0.0:  # the first sample
            m.way[k], m.turn[k], m.far[k] = 1.0, value, value
            m.turn_at[k] = m.far_at[k] = m.now
        if m.way[k] * (value - m.far[k]) > 0.0:
            m.far[k], m.far_at[k] = value, m.now
        limit = _limit(m, k, float(LEAST[k]))
        size = 0.5 * m.way[k] * (m.far[k] - m.turn[k])
        lasts = m.far_at[k] - m.turn_at[k]
        if size > limit and m.channel in (-1, k) and _goes_on(m, k, size, lasts):
            m.channel, m.until = k, m.now + OVER
            m.frequency = 1.0 / (m.lasted[k, 0] + m.lasted[k, 1])
        if m.way[k] * (m.far[k] - value) > max(SEEN * limit, TURNED * size):
            _turn(m, k, value, size, lasts, limit)
    if m.channel >= 0 and m.now > m.until:
        m.channel, m.frequency = -1, 0.0
    m.distance = math.sqrt(square)
    m.far_for = m.far_for + dt if m.distance > FAR else 0.0
    if m.channel < 0 and m.far_for > FAR_FOR:
        return OFF
    return int(m.channel)


class OscillationWatch:
    """Judge of each tick in which a reference is flown.

    Args:
        state, reference: STATE and REFERENCE (1,) of the tick, read in each step.
        say: takes a line for the log and its level.

    Attributes:
        flags: bits of vehicle.modes.Flag.
        cause: what was found in this flight, empty while there is nothing; for people.
        memory: WATCH (1,).
    """

    def __init__(self, state: Record, reference: Record, say: Callable[[str, int], None]) -> None:
        self.memory = np.zeros(1, WATCH)
        self.flags, self.cause = 0, ""
        self._state, self._reference, self._say = state, reference, say
        self._watch = direct(watch, state, reference, self.memory, 0.002)
        self._begin("")

    @property
    def frequency(self) -> float:
        """Return the frequency of the oscillation, Hz; 0 without one."""
        return float(self.memory["frequency"][0])

    def step(self, dt: float, source: str) -> None:
        """Judge one tick; `source` is that of the estimate while a reference is flown in the air,
        else empty. Another one has other noise, so that the flight then has no past.
        """
        if source != self._source:
            self._begin(source)
        if not source:
            return
        found = self._watch(self._state, self._reference, self.memory, dt)
        if found != self._found:
            self._tell(found)

    def _begin(self, source: str) -> None:
        self.memory[:] = 0
        self.memory["channel"] = -1
        self._source, self._found, self.flags, self.cause = source, -1, 0, ""

    def _tell(self, found: int) -> None:
        """Tell what has begun, or is over."""
        before, self._found = self.cause, found
        self.flags = (
            0 if found < 0 else int(Flag.OFF_REFERENCE if found == OFF else Flag.OSCILLATING)
        )
        if found < 0:
            self.cause = ""
            self._say(f"no longer {before}", mailbox.INFO)
            return
        far = f"{1e3 * self.memory['distance'].item():.0f} mm from its reference"
        if found == OFF:
            self.cause = far
        else:
            self.cause = f"oscillating in {CHANNELS[found]} at {self.frequency:.1f} Hz, {far}"
        self._say(self.cause, mailbox.WARN)
