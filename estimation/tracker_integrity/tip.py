"""A tracker whose attitude jumps in flight: a body that is shown upside down, or turned about.

No body turns between two poses faster than its gyroscope can measure, and no frame of a tracker is
moved so that the vertical jumps, or the heading alone while the position goes on. So nothing needs
to be gathered: some poses in a row that agree about the new attitude are a contradiction, which
ends when a pose shows the vertical of the estimate again, and its heading if that has jumped.
Followed, such poses would look like a vehicle that has turned over, or push it the wrong way. A
heading that jumps together with the position may be that of the tracker's frame.
"""

from __future__ import annotations

import math

from estimation.tracker_integrity.felt import CLIPPED_RATE
from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import (
    Quaternion,
    Vector,
    along,
    axes_of,
    length,
    multiply,
    quaternion,
    subtract,
    turned,
    vector,
)

LEAST_TIP, LEAST_HEADING = 0.14, 0.5
"""Least angles, in rad, between two verticals and between two headings, with more by what a quick
turn between two poses adds. The vehicle can be flown with a smaller error of the heading."""
STAYED = 0.1
"""Distance, in m, up to which the position goes on where it was: a frame that is moved takes it
along."""
ALIKE = 0.1
"""Largest angle, in rad, between the attitudes of two poses that agree."""
TIPS = 3
"""Number of poses in a row that agree."""


@compiled(inner=True)
def note_tip(m: Item, z: Item, state: Item, since: float) -> bool:
    """Note an outlier `since` (s) after the last pose that was none; return whether the attitude
    has jumped.

    `m.felt` is the turn since then; the velocity is that of a STATE.
    """
    felt = turned(quaternion(m.quaternion_wb), vector(m.felt.turn_b))
    jump, tip = _between(felt, quaternion(z.quaternion_wb))
    expected_w = along(vector(m.position_w), since, vector(state.velocity_w))
    stays = length(subtract(vector(z.position_w), expected_w)) < STAYED
    more = CLIPPED_RATE * since if m.tips == 0 else 0.0
    has_jumped = tip > LEAST_TIP + more or (stays and _angle(jump) > LEAST_HEADING + more)
    if m.tips > 0:
        has_jumped = has_jumped and _angle(_between(quaternion(m.jump_b), jump)[0]) < ALIKE
    m.tips = m.tips + 1 if has_jumped and m.carried > 0.0 else 0
    for i in range(4):
        m.jump_b[i] = jump[i]
    m.tipped = 1 if m.tips >= TIPS else 0
    found: bool = m.tipped == 1
    return found


@compiled(inner=True)
def stands_as(z: Item, state: Item) -> bool:
    """Return whether a pose has the vertical of a STATE, and about its heading."""
    jump, tip = _between(quaternion(state.quaternion_wb), quaternion(z.quaternion_wb))
    return tip < ALIKE and _angle(jump) < LEAST_HEADING


@compiled(inner=True)
def _between(one: Quaternion, other: Quaternion) -> tuple[Quaternion, float]:
    """Return the rotation from one attitude to another, and how far the vertical moves in the
    body's axes.
    """
    w, x, y, z = one
    return multiply((w, -x, -y, -z), other), length(subtract(_up(one), _up(other)))


@compiled(inner=True)
def _angle(q: Quaternion) -> float:
    """Return the angle (rad) of a rotation."""
    return 2.0 * math.atan2(length((q[1], q[2], q[3])), abs(q[0]))


@compiled(inner=True)
def _up(q: Quaternion) -> Vector:
    """Return the vertical in body axes."""
    x, y, z = axes_of(q)
    return x[2], y[2], z[2]
