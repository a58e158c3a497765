"""The definition of a signal, and where its value comes from."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Signal:
    name: str  # `state.position.x`
    label: str  # `x`
    unit: str
    group: str  # `position`
    topic: str  # whose age it has


@dataclass(frozen=True, slots=True)
class Source:
    """Turns the newest message of each topic into the values of its signals, in their order."""

    topics: tuple[str, ...]  # all must be current; the first one's age is shown
    signals: tuple[Signal, ...]
    values: Callable[..., Sequence[float]]
    covers: tuple[str, ...] = ()  # numbers that these show, as `state.pose.pose.position`


def one(name: str, label: str, unit: str, group: str, topic: str) -> Signal:
    return Signal(name, label, unit, group, topic)


def xyz(prefix: str, group: str, unit: str, topic: str) -> list[Signal]:
    return [Signal(f"{prefix}.{axis}", axis, unit, group, topic) for axis in "xyz"]


def vector(v: Any) -> tuple[float, float, float]:
    return (v.x, v.y, v.z)


def quaternion(q: Any) -> tuple[float, float, float, float]:
    """Return w, x, y, z of a geometry_msgs/Quaternion."""
    return (q.w, q.x, q.y, q.z)


def norm(v: Any) -> float:
    return math.sqrt(v.x * v.x + v.y * v.y + v.z * v.z)


def rms(*variances: float) -> float:
    """Return the length that an error of these variances has in the mean square."""
    total = float(sum(variances))
    return math.sqrt(total) if total >= 0.0 else math.nan
