"""A gyroscope axis that is stuck, and the rate that stands in for it.

Without a rate an attitude has no damping, and turns over within a second or two. The motors'
torques are commanded, so the rate is known without the gyroscope: an observer per axis integrates
them, and follows the gyroscope while its reading changes, which gives the torque that is not
commanded. Where a reading stays the same to the last bit, the observer goes on by the torques, and
follows the turns between the tracker's poses. When its rate and that of the tracker are then far
from the reading, on the same side, and the torques have turned the vehicle since the reading last
changed, the axis is stuck, and the observer's rate stands in for it until the reading changes.

A reading in whole counts stays the same in flight too: at rest, and in a steady turn. There the
errors of the torques add up, and the observer follows the noise of the tracker's turns; hence both
have to agree, and the torques alone must have turned the vehicle meanwhile.
"""

from __future__ import annotations

import math

from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import Vector

UNCHANGED = 0.02
"""Time, in s, from which on a reading that stays the same is no measurement."""
LEAST_SAMPLES = 8
"""Number of samples for which it stays so at least, which matters at low rates."""
AIRBORNE = 1.0
"""Time, in s, from which on the motors have carried the vehicle and their torques turn it."""
STUCK_RATE = math.radians(6.0)
"""Difference, in rad/s, that noise and gusts do not make."""
TURNED = 0.5 * STUCK_RATE
"""Change of the rate, in rad/s, by the torques alone while the reading stayed the same."""
TURN_TIME = 0.1
"""Time constant, in s, of the rate of the tracker's turns: 0.15° of noise become 1.5°/s."""
GYROSCOPE_POLE, TRACKER_POLE = 10.0, 4.0
"""Double poles, in rad/s, with which the observer follows the gyroscope and the tracker."""


@compiled(inner=True)
def observe_rates(m: Item, imu: Item, actuators: Item, model: Item, dt: float) -> None:
    """Step the observer by one IMU sample, whose stuck axes get its rate."""
    share = min(1.0, dt / model.motor_time_constant)
    held = max(UNCHANGED, (LEAST_SAMPLES - 0.5) * dt)
    for i in range(3):
        reading = imu.angular_velocity_b[i]
        m.push_b[i] += share * (actuators.wrench[1 + i] / model.inertia_b[i] - m.push_b[i])
        driven = dt * (m.push_b[i] + m.push_offset_b[i])
        m.rate_b[i] += driven
        m.driven_b[i] += driven
        m.unchanged[i] = m.unchanged[i] + dt if reading == m.reading_b[i] else 0.0
        m.reading_b[i] = reading
        if m.unchanged[i] < held:
            _follow(m, i, reading, GYROSCOPE_POLE, dt)
            m.driven_b[i] = 0.0
        if m.unchanged[i] == 0.0 or m.carried < AIRBORNE:
            m.stuck[i] = 0
        elif m.unchanged[i] >= held and (
            _is_beyond(m.rate_b[i], m.turn_rate_b[i], reading, m.driven_b[i])
            or _is_beyond(-m.rate_b[i], -m.turn_rate_b[i], -reading, -m.driven_b[i])
        ):
            m.stuck[i] = 1
        if m.stuck[i] == 1:
            imu.angular_velocity_b[i] = m.rate_b[i]


@compiled(inner=True)
def _is_beyond(rate: float, turn_rate: float, reading: float, driven: float) -> bool:
    """Return whether observer and tracker are above a reading, and the torques rose the rate."""
    return min(rate, turn_rate) > reading + STUCK_RATE and driven > TURNED


@compiled(inner=True)
def note_turn(m: Item, turned_b: Vector, since: float) -> None:
    """Follow the rate of the turn (rad) from the last pose that was compared to this one."""
    share = min(1.0, since / TURN_TIME)
    for i in range(3):
        m.turn_rate_b[i] += share * (turned_b[i] / since - m.turn_rate_b[i])


@compiled(inner=True)
def follow_tracker(m: Item, turned_b: Vector, since: float) -> None:
    """Let the axes without a measurement follow the turn (rad) between two poses."""
    for i in range(3):
        if m.unchanged[i] >= UNCHANGED:
            _follow(m, i, turned_b[i] / since, TRACKER_POLE, since)


@compiled(inner=True)
def _follow(m: Item, axis: int, rate: float, pole: float, dt: float) -> None:
    held = min(dt, 0.2 / pole)
    error = rate - m.rate_b[axis]
    m.rate_b[axis] += 2.0 * pole * held * error
    m.push_offset_b[axis] += pole * pole * held * error
