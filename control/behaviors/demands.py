"""The demands of a trajectory on the vehicle, as its preview reports them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Preview:
    """The demands of a trajectory on the vehicle."""

    points: list[tuple[float, float, float]]  # m, world, evenly over time
    duration: float  # s
    speed: float  # m/s, the largest
    refusal: str  # "" where the vehicle can fly it
