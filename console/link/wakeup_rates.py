"""The rates at which a station wakes the processor for each of its vehicles: lower for many."""

from __future__ import annotations

from dataclasses import dataclass

from vehicle_link.transport.heartbeat import LINK_HEARTBEAT_EVERY

FEW = 3
"""Largest number of vehicles of one process that each run at the rates of a single one."""


@dataclass(frozen=True, slots=True)
class WakeupRates:
    """The rates of one vehicle.

    Attributes:
        heartbeat_period: s between two heartbeats.
        zenoh_heartbeat_every: one in this many of the heartbeats over the lane is sent over Zenoh
            too.
        write_period: s between two writes of a run, which a killed station loses.
    """

    heartbeat_period: float
    zenoh_heartbeat_every: int
    write_period: float


ALONE, MANY = WakeupRates(0.05, 1, 0.02), WakeupRates(0.1, LINK_HEARTBEAT_EVERY, 0.04)


def wakeup_rates(vehicles: int) -> WakeupRates:
    """Return the rates for each of this many vehicles of one process."""
    return ALONE if vehicles <= FEW else MANY
