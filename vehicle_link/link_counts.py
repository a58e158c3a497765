"""Counters of the link between flight stack and board."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class LinkCounts:
    """Counts of a board's link since its start.

    Attributes:
        commands: commands sent.
        answered: requests answered.
        round_trips_ns: sum of their round trips.
        sent: packets that the other side has to acknowledge; 0 on a link without acknowledgements.
        acknowledged: those that it acknowledged.
        retries: transmissions of these beyond the first.
        waiting: packets that wait to be sent now.
    """

    commands: int = 0
    answered: int = 0
    round_trips_ns: int = 0
    sent: int = 0
    acknowledged: int = 0
    retries: int = 0
    waiting: int = 0
