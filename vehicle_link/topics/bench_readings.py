"""Readings of a force/torque sensor, on which a rotor is measured."""

from __future__ import annotations

from functools import cache

from vehicle_link.messages.cdr_layout import FixedLayout
from vehicle_link.topics.ticks import set_stamps


@cache
def _layout() -> FixedLayout:
    return FixedLayout("quadlab_msgs/BenchReading")


def encode_bench_reading(stamp_ns: int, force: float, torque: float, speed: float) -> bytes:
    """Encode quadlab_msgs/BenchReading: N, N m, and the speed in any unit, NaN without a
    tachometer.
    """
    out = _layout().new()
    set_stamps(out, stamp_ns)
    out["force"], out["torque"], out["speed"] = force, torque, speed
    return out.tobytes()
