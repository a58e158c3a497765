"""The tracker that a simulated flight of `benchmarks.onboard.tracker_integrity` is flown on, with
what may be wrong with it.

A lie changes a true pose; the errors that are no lie are always there, and each flight has its own.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from extensions.batches.noise import normals, uniform
from quadrotor.compiled import compiled
from quadrotor.records import POSE_SAMPLE
from quadrotor.vectors import (
    Quaternion,
    Vector,
    axes_of,
    multiply,
    quaternion,
    scale,
    to_world,
    turned,
    vector,
)

Item = Any
"""One record `array[k]` inside compiled code."""

LIES = (
    "none",
    "left-handed: y to the right",
    "left-handed: x to the back",
    "left-handed: z down",
    "attitude from world to body",
    "body's axes turned by 90° about z",
    "positions alone mirrored along y",
    "positions alone with x and y exchanged",
    "world tilted by 2°",
    "world tilting by 0.2°/s",
    "body's axes tilted by 2°",
    "positions 5 % too large",
    "stamps 40 ms too late",
    "delay growing by 5 ms/s",
)
"""The lies, by their numbers in `lie`."""
UNDER_WAY = 32

LYING_TRACKER = np.dtype(
    [
        ("interval_ns", "i8"),
        ("delay_ns", "i8"),
        ("stamp_error_ns", "i8"),  # too late
        ("position_noise", "f8"),  # m
        ("attitude_noise", "f8"),  # rad
        ("drop_out", "f8"),  # share of poses lost
        ("world_tilt", "f8", 3),  # rad
        ("body_turn", "f8", 3),  # rad
        ("size", "f8"),  # of positions, 1 when right
        ("lie", "i8"),  # of LIES
        ("lies_ns", "i8"),  # from this time on
        ("next_ns", "i8"),
        ("taken", "i8"),
        ("given", "i8"),
        ("arrival_ns", "i8", UNDER_WAY),
        ("pose", POSE_SAMPLE, UNDER_WAY),
    ],
    align=True,
)


@compiled(inner=True)
def _tilted(p: Vector, q: Quaternion, turn: Vector) -> tuple[Vector, Quaternion]:
    """Return a pose in a world turned by a rotation vector."""
    by = turned((1.0, 0.0, 0.0, 0.0), turn)
    return to_world(axes_of(by), p), multiply(by, q)


@compiled(inner=True)
def lie(number: int, past: float, p: Vector, q: Quaternion) -> tuple[Vector, Quaternion]:
    """Return the pose that the tracker claims, `past` (s) after it began to lie."""
    w, x, y, z = q
    if number == 1:
        return (p[0], -p[1], p[2]), (w, -x, y, -z)
    if number == 2:
        return (-p[0], p[1], p[2]), (w, x, -y, -z)
    if number == 3:
        return (p[0], p[1], -p[2]), (w, -x, -y, z)
    if number == 4:
        return p, (w, -x, -y, -z)
    if number == 5:
        return p, turned(q, (0.0, 0.0, 0.5 * math.pi))
    if number == 6:
        return (p[0], -p[1], p[2]), q
    if number == 7:
        return (p[1], p[0], p[2]), q
    if number == 8:
        return _tilted(p, q, (math.radians(2.0), 0.0, 0.0))
    if number == 9:
        return _tilted(p, q, (math.radians(0.2) * past, 0.0, 0.0))
    if number == 10:
        return p, turned(q, (math.radians(2.0), 0.0, 0.0))
    if number == 11:
        return scale(1.05, p), q
    return p, q


@compiled(inner=True)
def observe(t: Item, x: Any, stamp_ns: int, random: Any, drawn: Any) -> None:
    """Measure a pose of the true state x (13,) when one is due.

    Args:
        t: LYING_TRACKER.
        drawn: (6,), buffer for random numbers.
    """
    if stamp_ns < t.next_ns:
        return
    t.next_ns += t.interval_ns
    normals(random, drawn)
    if uniform(random) < t.drop_out:
        return
    p, q = vector(x), quaternion(x[6:])
    late_ns, arrives_ns, past = 0, stamp_ns + t.delay_ns, 1e-9 * (stamp_ns - t.lies_ns)
    if past >= 0.0:
        p, q = lie(t.lie, past, p, q)
        if t.lie == 12:
            late_ns = 40_000_000
            arrives_ns = max(arrives_ns, stamp_ns + late_ns)
        if t.lie == 13:
            late_ns = min(int(5e6 * past), 100_000_000)
            arrives_ns = max(arrives_ns, stamp_ns + late_ns)
    p, q = _tilted(scale(t.size, p), q, vector(t.world_tilt))
    q = turned(q, vector(t.body_turn))
    n = t.attitude_noise
    q = turned(q, (n * drawn[3], n * drawn[4], n * drawn[5]))
    k = t.taken % UNDER_WAY
    t.arrival_ns[k] = arrives_ns
    z = t.pose[k]
    z.stamp_ns = stamp_ns + late_ns + t.stamp_error_ns
    for i in range(3):
        z.position_w[i] = p[i] + t.position_noise * drawn[i]
    for i in range(4):
        z.quaternion_wb[i] = q[i]
    t.taken += 1
