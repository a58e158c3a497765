"""Comparison of a run with the vehicle's own log: what was lost, and what is still missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from flight_log.tick_columns import TICK_TOPICS
from flight_log.vehicle_messages import LogOverview, Selection, Stamps, stamps_of

HOLE_PERIODS = 1.5
"""Number of usual periods between two ticks above which there is a hole."""
EDGE_NS = 150_000_000
"""Time from the vehicle's last tick, in ns, within which its log ends."""


@dataclass
class Comparison:
    """The comparison of a run with the vehicle's own log; times in s of ticks.

    Attributes:
        messages: number in the merged log; 0 when none was made.
        filled: ticks that only the vehicle's log has.
        missing: ticks that neither log has, though the vehicle flew them.
        total: ticks that the run would have without holes.
        ticks: number of ticks that it has.
        why: reason why ticks are missing.
        problems: of the vehicle's logs, a line each.
    """

    messages: int = 0
    filled: float = 0.0
    missing: float = 0.0
    total: float = 0.0
    ticks: int = 0
    why: str = ""
    problems: list[str] = field(default_factory=list)


def compare(
    station: LogOverview, taken: Sequence[Selection], oldest_on_board_ns: int
) -> Comparison:
    """Return the comparison of the run with the vehicle's own log.

    Args:
        oldest_on_board_ns: when the oldest log on board begins; 0 when there is none.
    """
    found = Comparison()
    before = _common([stamps_of(station, name) for name in TICK_TOPICS])
    after = _common(
        [
            np.concatenate(
                [stamps_of(station, name), *(stamps_of(one.log, name, one.kept) for one in taken)]
            )
            for name in TICK_TOPICS
        ]
    )
    ticks = before if len(before) > 1 else after
    period = int(np.median(np.diff(ticks))) if len(ticks) > 1 else 0
    missing, first_hole, is_armed = 0, 0, False
    steps = np.diff(after)
    for k in np.flatnonzero(steps > HOLE_PERIODS * period).tolist() if period else ():
        begin, end = int(after[k]), int(after[k + 1])
        armed = _is_armed_after(station, end)
        if not _is_known(taken, begin, end, armed):
            missing += max(1, round((end - begin) / period) - 1)
            first_hole = first_hole or begin
            is_armed = is_armed or armed
    seconds = period * 1e-9
    found.ticks = len(after)
    found.filled = (len(after) - len(before)) * seconds
    found.missing, found.total = missing * seconds, (len(after) + missing) * seconds
    if missing:
        if any(one.log.reader.damaged_chunks for one in taken):
            found.why = "the vehicle's log of it is damaged"
        elif oldest_on_board_ns > first_hole:
            found.why = "the vehicle's log of it was overwritten"
        elif not is_armed:
            found.why = "the vehicle was not armed, and logged nothing"
        else:
            found.why = "the vehicle has no log of it"
    return found


def _is_armed_after(station: LogOverview, stamp_ns: int) -> bool:
    """Return whether the vehicle was armed in the next status received."""
    after = (armed for stamp, armed in sorted(station.armed.items()) if stamp >= stamp_ns)
    return next(after, False)


def _is_known(taken: Sequence[Selection], begin: int, end: int, armed: bool) -> bool:
    """Return whether the vehicle's log shows that it has no ticks there either, as it logs only
    while it is armed.
    """
    for source in taken:
        first_ns, last_ns = source.log.span
        inside = first_ns <= begin and end <= last_ns
        if inside and not source.log.reader.damaged_chunks:
            return True
        is_end = last_ns < end and last_ns >= begin - EDGE_NS and not source.log.reader.tear
        if is_end and not armed:
            return True
    return False


def _common(topics: list[Stamps]) -> Stamps:
    """Return the stamps that all topics have, rising."""
    found = np.unique(topics[0])
    for stamps in topics[1:]:
        found = np.intersect1d(found, stamps)
    return found
