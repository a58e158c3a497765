"""The rates at which a station wakes the processor for each of its vehicles: lower for many."""

from __future__ import annotations

from dataclasses import dataclass

from vehicle_link.transport.heartbeat import LINK_HEARTBEAT_EVERY

FEW = 3
"""Largest number of vehicles of one process that each run at the rates of a single one."""


@dataclass(frozen=True, slots=True)
class Pace:
    """The rates of one vehicle.

    Attributes:
        beat: s between two heartbeats.
        beats_over_link: of the heartbeats over the lane, one in this many is sent over Zenoh too.
        written: s between two writes of a run, which a killed station loses.
    """

    beat: float
    beats_over_link: int
    written: float


ALONE, MANY = Pace(0.05, 1, 0.02), Pace(0.1, LINK_HEARTBEAT_EVERY, 0.04)


def pace_of(vehicles: int) -> Pace:
    """Return the rates for each of this many vehicles of one process."""
    return ALONE if vehicles <= FEW else MANY
