"""Measurements in the order of their stamps, whatever the order in which they arrive.

The filter proper is at the newest event; the state that a tick reads is predicted from there along
the stored IMU samples. A delayed measurement newer than the last one therefore costs no
approximation and no second covariance. For an older one the filter returns to its state after the
preceding event, which is stored with each event, and applies the later ones again.
"""

from __future__ import annotations

from estimation.error_state.memory import ERRORS, EVENTS, NOMINAL, NOTHING, READING, SAMPLES
from estimation.error_state.motion import walk
from estimation.error_state.update import fuse
from estimation.outcome import LATEST_NS, Outcome
from quadrotor.compiled import compiled
from quadrotor.records import Item

_MASK = SAMPLES - 1
_APPLIED, _TOO_OLD, _NOT_NEWER, _AHEAD, _, _OUTLIER = (int(o) for o in Outcome)


@compiled(inner=True)
def insert(m: Item) -> int:
    """Insert the new measurement in order; return its position, or minus an Outcome."""
    order, stamps, count, stamp_ns = m.event_order, m.event_ns, m.event_count, m.new_ns
    if stamp_ns > m.stamp_ns:
        return -_AHEAD
    position = count
    while position > 0 and stamps[order[position - 1]] > stamp_ns:
        position -= 1
    if position == 0 or (position < count and stamp_ns < m.stamp_ns - LATEST_NS):
        return -_TOO_OLD
    before = order[position - 1]
    repeats = stamps[before] == stamp_ns and m.event_kind[before] == m.new_kind
    if repeats and m.new_kind != READING:  # several sensors may be read at once
        return -_NOT_NEWER
    full = 1 if count == EVENTS else 0
    if position < count:
        oldest = m.sample_ns[(m.sample_next - m.sample_count) & _MASK]
        if stamps[before] < oldest or (full and position == 1):
            return -_TOO_OLD
    slot = count
    if full:  # the oldest one is overwritten
        slot = order[0]
        position -= 1
        for i in range(position):
            order[i] = order[i + 1]
    else:
        for i in range(count, position, -1):
            order[i] = order[i - 1]
        m.event_count = count + 1
    order[position] = slot
    stamps[slot], m.event_kind[slot] = stamp_ns, m.new_kind
    m.event_beacons[slot], m.event_sigma[slot] = m.new_count, m.new_sigma
    for k in range(m.new_count):
        for i in range(6):
            m.event_data[slot, k, i] = m.new_data[k, i]
    return int(position)


@compiled
def apply_one(m: Item, g: Item) -> int:
    """Apply the new measurement of an initialized filter, and predict to now; return an Outcome,
    which is counted except for readings.

    Args:
        m: ERROR_STATE_MEMORY item; `take_pose`, `take_bearings` store the measurement in it.
        g: ERROR_STATE_NOISE item.
    """
    outcome = _apply(m, g)
    if m.new_kind not in (NOTHING, READING):
        m.outcomes[outcome] += 1
    return outcome


@compiled(inner=True)
def _apply(m: Item, g: Item) -> int:
    position = insert(m)
    if position < 0:
        return -position
    x, P, order, outcome = m.base, m.covariance, m.event_order, _APPLIED
    if position < m.event_count - 1:
        before = order[position - 1]
        m.base_ns = m.event_ns[before]
        for i in range(NOMINAL):
            x[i] = m.after_state[before, i]
        for i in range(ERRORS):
            for j in range(ERRORS):
                P[i, j] = m.after_covariance[before, i, j]
    # The last pass applies no event, and only propagates from the newest one to now.
    for k in range(position, m.event_count + 1):
        last = k == m.event_count
        event = order[min(k, m.event_count - 1)]
        end_ns = m.stamp_ns if last else m.event_ns[event]
        if last:
            for i in range(NOMINAL):
                m.now[i] = x[i]
            x = m.now
        walk(m, x, m.base_ns, end_ns, g, not last)
        if last:
            break
        m.base_ns = end_ns
        if not fuse(m, event, g, k == position) and k == position:
            outcome = _OUTLIER
        for i in range(NOMINAL):
            m.after_state[event, i] = x[i]
        for i in range(ERRORS):
            for j in range(ERRORS):
                m.after_covariance[event, i, j] = P[i, j]
    is_evidence = m.new_kind not in (NOTHING, READING)
    if outcome == _APPLIED and is_evidence and m.believed:
        m.measurement_ns = max(m.measurement_ns, m.new_ns)
    return outcome
