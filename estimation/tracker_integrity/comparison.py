"""The tracker's poses against the inertial sensors, independently of any estimator.

Between two poses the IMU says how the body turned and how it was accelerated. Both sides pass
through the same high-pass filters of second order, for the turn (`TURN_RATE`) and for the
displacement (`PLACE_RATE`), so that an unknown start does not matter, nor a bias of the gyroscope,
however it changes: `t` is what is left of the tracker's motion, `g` what is left of the IMU's. A
bias of the accelerometer adds a constant to g, the mean of g - t, which is taken off. Then both are
equal but for noise if the tracker is right.

Poses that suddenly differ are left out, and the filters begin there if they stay. In flight they
are wrong at once when they have another vertical, or another heading in the same place (`tip`).
"""

from __future__ import annotations

import math
from typing import Any

from estimation.tracker_integrity.evidence import (
    KNOWN,
    MOST,
    has_jumped,
    is_outlier,
    judge,
    strongest,
    unknown,
)
from estimation.tracker_integrity.felt import feel
from estimation.tracker_integrity.high_pass import keep, passed
from estimation.tracker_integrity.memory import RING_LENGTH
from estimation.tracker_integrity.slopes import PLACE_RATE, fit
from estimation.tracker_integrity.stuck_axis import follow_tracker, note_turn
from estimation.tracker_integrity.tip import note_tip, stands_as
from estimation.tracker_integrity.witnesses import agree, overrule, vote
from quadrotor.compiled import compiled
from quadrotor.records import Item, Record
from quadrotor.vectors import (
    Quaternion,
    Vector,
    along,
    length,
    multiply,
    quaternion,
    scale,
    subtract,
    vector,
)

LONGEST_GAP = 0.3
"""Longest time, in s, between two poses that are compared."""
TURN_RATE, QUICK_RATE = 0.65, 2.0
"""Double poles, in rad/s, of the high-passes of turns: what is compared, and what a bias of the
gyroscope is not seen in."""
OUTLIERS = 0.15
"""Time, in s, after which poses that are outliers have jumped: the filters begin there."""
SETTLING = 1.0
"""Time, in s, in which the filters forget their first start and nothing is judged."""


@compiled
def compare_pose(memory: Record, pose: Record, state: Record) -> float:
    """Compare a POSE_SAMPLE (1,) that has an attitude with the samples since the last one.

    Args:
        memory: INTEGRITY_MEMORY (1,).
        state: STATE (1,), whose velocity begins the filters, and whose attitude is that of the IMU
            while poses count as missing.

    Returns the largest evidence, or -1 for a pose that was not judged.
    """
    m, z = memory[0], pose[0]
    if m.tipped == 1:
        if not stands_as(z, state[0]):
            return MOST
        m.tipped = m.tips = 0
    since = 1e-9 * (z.stamp_ns - m.stamp_ns)
    if m.stamp_ns > 0 and since > -LONGEST_GAP and since <= 0.0:
        return -1.0
    if m.stamp_ns > 0 and since > 0.0 and since < LONGEST_GAP:
        felt = feel(m, z.stamp_ns)
        if felt and _take(m, z, since):
            overrule(m)
            return strongest(m) if m.learnt > KNOWN else -1.0
        if felt and note_tip(m, z, state[0], since):
            return MOST
        if felt and since < OUTLIERS:
            return -1.0
    _start(m, z, state[0])
    return -1.0


@compiled(inner=True)
def _start(m: Item, z: Item, state: Any) -> None:
    """Start the filters at this pose, in the state that constant errors lead to."""
    m.settled = 0.0
    for i in range(3):
        m.turn_felt_b[3 + i] -= m.turn_shown_b[3 + i]
        m.quick_felt_b[3 + i] -= m.quick_shown_b[3 + i]
        m.turn_shown_b[i] = m.turn_shown_b[3 + i] = m.turn_felt_b[i] = 0.0
        m.quick_shown_b[i] = m.quick_shown_b[3 + i] = m.quick_felt_b[i] = 0.0
        m.place_shown_w[i], m.place_shown_w[3 + i] = 0.0, -state.velocity_w[i]
        m.place_felt_w[i] = m.place_offset_w[i]
        m.place_felt_w[3 + i] = 2.0 * PLACE_RATE * m.place_offset_w[i]
        m.place_driven_w[i] = m.driven_offset_w[i]
        m.place_driven_w[3 + i] = 2.0 * PLACE_RATE * m.driven_offset_w[i]
    m.place_height_w[2], m.place_height_w[5] = 0.0, -state.velocity_w[2]
    m.height = m.ring[(m.ring_next - 1) % RING_LENGTH].height if m.ring_next else 0.0
    _note(m, z)


@compiled(inner=True)
def _note(m: Item, z: Item) -> None:
    m.stamp_ns = z.stamp_ns
    for i in range(3):
        m.position_w[i] = z.position_w[i]
    for i in range(4):
        m.quaternion_wb[i] = z.quaternion_wb[i]


@compiled(inner=True)
def _take(m: Item, z: Item, since: float) -> bool:
    """Step the filters by one pose and judge it; return False, without doing so, for an outlier."""
    felt, still = m.felt, (0.0, 0.0, 0.0)
    turn_b, place_w = vector(felt.turn_b), vector(felt.place_w)
    turned_b = _turn(quaternion(m.quaternion_wb), quaternion(z.quaternion_wb))
    moved_w = subtract(vector(z.position_w), vector(m.position_w))
    note_turn(m, turned_b, since)
    t_b, g_b = passed(m.turn_shown_b, turned_b, since), passed(m.turn_felt_b, turn_b, since)
    t_w, felt_w = passed(m.place_shown_w, moved_w, since), passed(m.place_felt_w, place_w, since)
    g_w = subtract(felt_w, vector(m.place_offset_w))
    is_settled = m.learnt > 0.0 or m.settled >= SETTLING
    if is_settled and (
        has_jumped(m, since, turned_b, turn_b)
        or is_outlier(t_b, g_b, m.turn_variance)
        or is_outlier(t_w, g_w, m.place_variance + unknown(m))
    ):
        return False
    quick_t_b = passed(m.quick_shown_b, turned_b, since)
    quick_g_b = passed(m.quick_felt_b, turn_b, since)
    driven_w = passed(m.place_driven_w, vector(felt.driven_place_w), since)
    height_w = passed(m.place_height_w, (0.0, 0.0, felt.height - m.height), since)
    if is_settled:
        judge(m, since, t_b, g_b, t_w, g_w)
        agree(m, since, quick_t_b, quick_g_b)
        vote(m, since, t_w, g_w, subtract(driven_w, vector(m.driven_offset_w)), height_w[2])
        rate_b = along(scale(1.0 / since, turn_b), -2.0 * TURN_RATE, g_b)
        rate_b = along(rate_b, 1.0, vector(m.turn_felt_b[3:]))
        fit(m, since, subtract(g_b, t_b), rate_b, t_w, felt_w)
    m.settled += since
    m.tips = 0
    keep(m.turn_shown_b, t_b, still, since, TURN_RATE)
    keep(m.turn_felt_b, g_b, still, since, TURN_RATE)
    keep(m.quick_shown_b, quick_t_b, still, since, QUICK_RATE)
    keep(m.quick_felt_b, quick_g_b, still, since, QUICK_RATE)
    if m.settled < 0.5 / TURN_RATE:  # at first off the mean: the pose at the start has noise
        left = 1.0 - since / m.settled
        for i in range(3):
            m.turn_shown_b[i], m.turn_felt_b[i] = left * t_b[i], left * g_b[i]
    keep(m.place_shown_w, t_w, still, since, PLACE_RATE)
    keep(m.place_felt_w, felt_w, vector(felt.velocity_w), since, PLACE_RATE)
    keep(m.place_driven_w, driven_w, vector(felt.driven_velocity_w), since, PLACE_RATE)
    keep(m.place_height_w, height_w, still, since, PLACE_RATE)
    follow_tracker(m, turned_b, since)
    m.height = felt.height
    _note(m, z)
    return True


@compiled(inner=True)
def _turn(before: Quaternion, now: Quaternion) -> Vector:
    """Return the rotation vector (rad, body axes) from one attitude to the next."""
    w, x, y, z = before
    dw, dx, dy, dz = multiply((w, -x, -y, -z), now)
    s = length((dx, dy, dz))
    k = 2.0 if s < 1e-9 else 2.0 * math.atan2(s, abs(dw)) / s
    if dw < 0.0:
        k = -k
    return k * dx, k * dy, k * dz
