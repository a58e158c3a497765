"""A tracker whose vertical jumps in flight: a body that is shown upside down, or on its side.

No frame of a tracker is moved so: its vertical was that of the accelerometer before. Nor does a
body turn so between two poses, faster than its gyroscope can measure. So nothing needs to be
gathered: some poses in a row that agree about the new vertical are a contradiction, which ends when
a pose shows the vertical of the estimate again. Followed, such poses would look like a vehicle that
has turned over. A jump of the heading alone may be that of the tracker's frame.
"""

from __future__ import annotations

from estimation.tracker_integrity.felt import CLIPPED_RATE
from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import (
    Quaternion,
    Vector,
    axes_of,
    length,
    quaternion,
    store,
    subtract,
    turned,
    vector,
)

LEAST_TIP = 0.14
"""Least angle, in rad, between two verticals; more by what a quick turn between two poses adds."""
ALIKE = 0.1
"""Largest angle, in rad, between the verticals of two poses that agree."""
TIPS = 3
"""Number of poses in a row that agree."""


@compiled(inner=True)
def note_tip(m: Item, z: Item, since: float) -> bool:
    """Note an outlier `since` (s) after the last pose that was none; return whether the vertical
    has jumped.

    `m.felt` is the turn since then.
    """
    up_b = _up(quaternion(z.quaternion_wb))
    felt_b = _up(turned(quaternion(m.quaternion_wb), vector(m.felt.turn_b)))
    off = length(subtract(up_b, felt_b))
    if m.tips == 0:
        is_tip = off > LEAST_TIP + CLIPPED_RATE * since
    else:
        is_tip = off > LEAST_TIP and length(subtract(up_b, vector(m.tip_up_b))) < ALIKE
    m.tips = m.tips + 1 if is_tip and m.carried > 0.0 else 0
    store(up_b, m.tip_up_b)
    m.tipped = 1 if m.tips >= TIPS else 0
    found: bool = m.tipped == 1
    return found


@compiled(inner=True)
def leans_as(z: Item, state: Item) -> bool:
    """Return whether a pose has the vertical of a STATE."""
    off = subtract(_up(quaternion(z.quaternion_wb)), _up(quaternion(state.quaternion_wb)))
    found: bool = length(off) < ALIKE
    return found


@compiled(inner=True)
def _up(q: Quaternion) -> Vector:
    """Return the vertical in body axes."""
    x, y, z = axes_of(q)
    return x[2], y[2], z[2]
