"""The motion between two poses as the IMU, the motors and the barometer tell it."""

from __future__ import annotations

from estimation.tracker_integrity.memory import RING_LENGTH
from estimation.tracker_integrity.stuck_axis import observe_rates
from quadrotor.compiled import compiled
from quadrotor.constants import GRAVITY
from quadrotor.records import Item, Record
from quadrotor.vectors import (
    Vector,
    along,
    axes_of,
    quaternion,
    scale,
    store,
    to_world,
    turned,
    vector,
)

CLIPPED_FORCE, CLIPPED_RATE = 19.0, 5.0
"""Specific force (m/s²) and rate (rad/s) near the limits of the paper's sensors, ± 2 g and
± 300 deg/s, beyond which a sample shows nothing."""
PASCALS_PER_METRE = 11.6
"""Pressure gradient of the standard atmosphere in the lowest few hundred metres."""
CARRIED = 0.5
"""Share of the weight from which on the motors may carry the vehicle."""


@compiled
def note_sample(
    memory: Record, imu: Record, actuators: Record, model: Record, pressure: float
) -> None:
    """Store the witnesses of one tick in INTEGRITY_MEMORY (1,).

    Args:
        imu: IMU_SAMPLE (1,); rates of stuck axes are replaced.
        actuators: ACTUATORS (1,), commanded in the last tick.
        model: MODEL (1,).
        pressure: Pa.
    """
    m, s = memory[0], imu[0]
    kept = m.ring[m.ring_next % RING_LENGTH]
    dt = 1e-9 * (s.stamp_ns - m.ring[(m.ring_next - 1) % RING_LENGTH].stamp_ns)
    if m.ring_next == 0 or not 0.0 < dt < 1.0:
        m.ground_pressure, dt = pressure, 0.0
    share = min(1.0, dt / model[0].motor_time_constant)
    m.lift += share * (actuators[0].wrench[0] / model[0].mass - m.lift)
    m.carried = m.carried + dt if m.lift > CARRIED * GRAVITY else 0.0
    observe_rates(m, s, actuators[0], model[0], dt)
    kept.stamp_ns = s.stamp_ns
    for i in range(3):
        kept.specific_force_b[i] = s.specific_force_b[i]
        kept.angular_velocity_b[i] = s.angular_velocity_b[i]
    kept.lift = m.lift if m.carried > 0.0 else s.specific_force_b[2]
    kept.height = (m.ground_pressure - pressure) / PASCALS_PER_METRE
    m.ring_next += 1


@compiled(inner=True)
def feel(m: Item, stamp_ns: int) -> bool:
    """Write what was felt from the last pose to this stamp; return whether that is known."""
    turn_b, velocity_w, place_w = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    driven_velocity_w, driven_place_w = velocity_w, place_w
    height, count = 0.0, 0.0
    first, oldest = m.ring_next, max(0, m.ring_next - RING_LENGTH)
    while first > oldest and m.ring[(first - 1) % RING_LENGTH].stamp_ns > m.stamp_ns:
        first -= 1
    if first == oldest:  # the samples begin after the last pose
        return False
    q, now_ns = quaternion(m.quaternion_wb), m.stamp_ns
    for k in range(first, m.ring_next + 1):
        is_newest = k == m.ring_next  # it holds until the pose
        s = m.ring[(k - 1 if is_newest else k) % RING_LENGTH]
        until_ns = stamp_ns if is_newest else min(s.stamp_ns, stamp_ns)
        dt = 1e-9 * (until_ns - now_ns)
        if dt <= 0.0:
            break
        rate_b, force_b = vector(s.angular_velocity_b), vector(s.specific_force_b)
        for i in range(3):
            if not (abs(force_b[i]) < CLIPPED_FORCE and abs(rate_b[i]) < CLIPPED_RATE):
                return False
        axes = axes_of(q)
        place_w, velocity_w = _moved(place_w, velocity_w, to_world(axes, force_b), dt)
        lift_w = scale(s.lift, axes[2])
        driven_place_w, driven_velocity_w = _moved(driven_place_w, driven_velocity_w, lift_w, dt)
        height, count = height + s.height, count + 1.0
        turn_b = along(turn_b, dt, rate_b)
        q, now_ns = turned(q, scale(dt, rate_b)), until_ns
    felt = m.felt
    store(turn_b, felt.turn_b)
    store(velocity_w, felt.velocity_w)
    store(place_w, felt.place_w)
    store(driven_velocity_w, felt.driven_velocity_w)
    store(driven_place_w, felt.driven_place_w)
    felt.height = height / count if count > 0.0 else m.height
    return True


@compiled(inner=True)
def _moved(
    place_w: Vector, velocity_w: Vector, force_w: Vector, dt: float
) -> tuple[Vector, Vector]:
    """Return displacement (m) and velocity (m/s) after dt (s) of this specific force."""
    acceleration_w = force_w[0], force_w[1], force_w[2] - GRAVITY
    place_w = along(along(place_w, dt, velocity_w), 0.5 * dt * dt, acceleration_w)
    return place_w, along(velocity_w, dt, acceleration_w)
