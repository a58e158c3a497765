"""The last predicted poses, so that a late measurement meets the estimate of its own time.

A correction is also written into the poses since then: otherwise each measurement on its way
would correct the same error again, and a delay near 1 / bandwidth would make the filter swing.

The functions take one ESTIMATOR_MEMORY record.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from estimation.attitude_filter import propagate_attitude
from estimation.memory import HISTORY_LENGTH
from quadrotor.rotations import quaternion_exp

Array = npt.NDArray[np.float64]


@njit(cache=True)
def remember(m: Any) -> None:
    """Push the present pose."""
    i = m.ring_next
    m.ring_stamp_ns[i] = m.stamp_ns
    for j in range(3):
        m.ring_position_w[i, j] = m.position_w[j]
    for j in range(4):
        m.ring_quaternion_wb[i, j] = m.quaternion_wb[j]
    m.ring_next = (i + 1) % HISTORY_LENGTH
    m.ring_count = min(m.ring_count + 1, HISTORY_LENGTH)


@njit(cache=True)
def recall(m: Any, stamp_ns: int) -> int:
    """Write the estimate at `stamp_ns` into past_position_w and past_quaternion_wb.

    Linear between the two poses around the stamp; a stamp ahead of the newest pose is met at
    the present velocity and rate. Returns how many poses are not older than the measurement, plus the
    one before it, or -1 when the stamp is older than the ring.
    """
    back = 1
    while True:
        if back > m.ring_count:
            return -1
        i = (m.ring_next - back) % HISTORY_LENGTH
        if m.ring_stamp_ns[i] <= stamp_ns:
            break
        back += 1
    share = 0.0
    j = i
    if back > 1:
        j = (i + 1) % HISTORY_LENGTH
        share = (stamp_ns - m.ring_stamp_ns[i]) / (m.ring_stamp_ns[j] - m.ring_stamp_ns[i])
    ahead = 0.0 if back > 1 else 1e-9 * (stamp_ns - m.ring_stamp_ns[i])
    for k in range(3):
        m.past_position_w[k] = (
            (1.0 - share) * m.ring_position_w[i, k]
            + share * m.ring_position_w[j, k]
            + ahead * m.velocity_w[k]
        )
    norm2 = 0.0
    for k in range(4):
        value = (1.0 - share) * m.ring_quaternion_wb[i, k] + share * m.ring_quaternion_wb[j, k]
        m.past_quaternion_wb[k] = value
        norm2 += value * value
    scale = 1.0 / math.sqrt(norm2)
    for k in range(4):
        m.past_quaternion_wb[k] *= scale
    if ahead > 0.0:
        propagate_attitude(m.past_quaternion_wb, m.filtered_rate_b, 0.0, ahead)
    return back


@njit(cache=True)
def amend(m: Any, back: int, stamp_ns: int, shift: Array, turn_w: Array) -> None:
    """Correct the newest `back` poses, and with the newest of them the present pose.

    Args:
        shift: (3, 3), rows position (m), velocity (m/s) and acceleration (m/s^2) at
            `stamp_ns`, in world axes; each pose moves by shift[0] + shift[1] t + shift[2] t^2/2.
        turn_w: (3,) rotation vector (rad) in world axes: an attitude error keeps its world
            axes while the body turns, so all poses turn by the same.
    """
    e = quaternion_exp(turn_w)
    for b in range(back, 0, -1):
        i = (m.ring_next - b) % HISTORY_LENGTH
        t = max(0.0, 1e-9 * (m.ring_stamp_ns[i] - stamp_ns))
        for k in range(3):
            m.ring_position_w[i, k] += shift[0, k] + t * (shift[1, k] + 0.5 * t * shift[2, k])
        w, x = m.ring_quaternion_wb[i, 0], m.ring_quaternion_wb[i, 1]
        y, z = m.ring_quaternion_wb[i, 2], m.ring_quaternion_wb[i, 3]
        m.ring_quaternion_wb[i, 0] = e[0] * w - e[1] * x - e[2] * y - e[3] * z
        m.ring_quaternion_wb[i, 1] = e[0] * x + w * e[1] + e[2] * z - e[3] * y
        m.ring_quaternion_wb[i, 2] = e[0] * y + w * e[2] + e[3] * x - e[1] * z
        m.ring_quaternion_wb[i, 3] = e[0] * z + w * e[3] + e[1] * y - e[2] * x
        if b == 1:
            for k in range(3):
                m.position_w[k] = m.ring_position_w[i, k]
                m.velocity_w[k] += shift[1, k] + t * shift[2, k]
            for k in range(4):
                m.quaternion_wb[k] = m.ring_quaternion_wb[i, k]
