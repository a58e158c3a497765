"""The last predicted poses, with which a delayed measurement is compared at its own time.

A correction is also applied to the poses since then: otherwise each measurement in transit would
correct the same error again, and a delay near 1 / bandwidth would make the filter oscillate. The
functions take one ESTIMATOR_MEMORY record.
"""

from __future__ import annotations

import math

from estimation.attitude_filter import Triple, turn_pose
from estimation.memory import HISTORY_LENGTH
from quadrotor.compiled import compiled
from quadrotor.records import Item

_MASK = HISTORY_LENGTH - 1  # the length is a power of two


@compiled(inner=True)
def remember(m: Item) -> None:
    """Store the present pose."""
    i = m.ring_next
    m.ring_stamp_ns[i] = m.stamp_ns
    ring, pose = m.ring_pose, m.pose
    for k in range(7):
        ring[i, k] = pose[k]
    m.ring_next = (i + 1) & _MASK
    if m.ring_count < HISTORY_LENGTH:
        m.ring_count += 1


@compiled
def recall(m: Item, stamp_ns: int) -> int:
    """Write the estimate at `stamp_ns` into `past`.

    It is linear between the two poses around the stamp; beyond the newest pose it is extrapolated
    with the present velocity and rate. Returns the number of poses that are not older than the
    measurement, plus the one before it, or -1 when the stamp is older than the ring.
    """
    stamps, ring, past = m.ring_stamp_ns, m.ring_pose, m.past
    back, i = 1, (m.ring_next - 1) & _MASK
    while back <= m.ring_count and stamps[i] > stamp_ns:
        back += 1
        i = (i - 1) & _MASK
    if back > m.ring_count:
        return -1
    j, share, ahead = i, 0.0, 0.0
    if back > 1:
        j = (i + 1) & _MASK
        share = (stamp_ns - stamps[i]) / float(stamps[j] - stamps[i])
    else:
        ahead = 1e-9 * (stamp_ns - stamps[i])
    norm2 = 0.0
    for k in range(7):
        past[k] = ring[i, k] + share * (ring[j, k] - ring[i, k])
        if k >= 3:
            norm2 += past[k] * past[k]
    scale = 1.0 / math.sqrt(norm2)
    for k in range(3):
        past[k] += ahead * m.velocity_w[k]
    for k in range(3, 7):
        past[k] *= scale
    rate = m.filtered_rate_b
    turn_pose(past, rate[0], rate[1], rate[2], 0.0, ahead)
    return back


@compiled(inner=True)
def amend(
    m: Item, back: int, stamp_ns: int, innovation_w: Triple, gains: Triple, turn_w: Triple
) -> None:
    """Correct the newest `back` poses, and with the newest of them the present pose.

    Args:
        innovation_w: m, in world axes.
        gains: of position, velocity and acceleration at `stamp_ns`: a pose t seconds later
            moves by (gains[0] + gains[1] t + gains[2] t^2 / 2) innovation_w.
        turn_w: rotation vector (rad) in world axes: an attitude error keeps its
            world axes while the body turns, so all poses turn by the same.
    """
    a, b, c = 0.5 * turn_w[0], 0.5 * turn_w[1], 0.5 * turn_w[2]
    half = math.sqrt(a * a + b * b + c * c)
    s, d = math.sin(half) / half if half > 1e-9 else 1.0, math.cos(half)
    a, b, c = s * a, s * b, s * c
    ring, stamps = m.ring_pose, m.ring_stamp_ns
    i = m.ring_next - back - 1
    t = 0.0
    for _ in range(back):
        i = (i + 1) & _MASK
        t = max(0.0, 1e-9 * (stamps[i] - stamp_ns))
        move = gains[0] + t * (gains[1] + 0.5 * t * gains[2])
        for k in range(3):
            ring[i, k] += move * innovation_w[k]
        w, x, y, z = ring[i, 3], ring[i, 4], ring[i, 5], ring[i, 6]
        ring[i, 3] = d * w - a * x - b * y - c * z
        ring[i, 4] = d * x + w * a + b * z - c * y
        ring[i, 5] = d * y + w * b + c * x - a * z
        ring[i, 6] = d * z + w * c + a * y - b * x
    for k in range(3):
        m.velocity_w[k] += (gains[1] + t * gains[2]) * innovation_w[k]
    for k in range(7):
        m.pose[k] = ring[i, k]
