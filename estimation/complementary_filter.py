"""The complementary filter in SE(3) of Sec. 6.1: prediction at the IMU's rate, delayed poses.

A pose is compared with the estimate at the pose's own stamp and, if it passes
`estimation.pose_gate`, applied at once. No measurement is ever held, so a lost tracker leaves a
prediction with the last biases (dead reckoning).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from estimation.attitude_filter import attitude_gains, attitude_innovation, to_world, turn_pose
from estimation.history import amend, recall, remember
from estimation.outcome import AHEAD_NS, NORM_TOLERANCE, Outcome
from estimation.pose_gate import chord2, move_to, passes, refuse, rotation_vector
from estimation.rate_filter import filter_rate
from estimation.translation_observer import acceleration_of, move_pose, translation_gains
from quadrotor.compiled import compiled
from quadrotor.records import Item, Record
from quadrotor.vectors import dot, multiply, normalized, quaternion, store

SPREAD = 0.1
"""Weight of the newest innovation in their mean square."""

_APPLIED, _TOO_OLD, _NOT_NEWER, _AHEAD, _INVALID, _OUTLIER = (int(o) for o in Outcome)


@compiled(inner=True)
def predict_one(m: Item, sample: Item, g: Item, dt: float, out: Item) -> None:
    """Advance one filter by one IMU sample; eqs. 11 and 12 without their innovation terms.

    Rate and acceleration are the mean of this sample and the last, each turned at its own attitude:
    this is second order, whereas holding the newest sample leads by half a period.

    Args:
        m: ESTIMATOR_MEMORY item.
        sample: IMU_SAMPLE item.
        g: ESTIMATION_GAINS item.
        dt: s since the last sample.
        out: STATE item, written.
    """
    pose, bias, last = m.pose, m.gyroscope_bias_b, m.rate_b
    rate, force = sample.angular_velocity_b, sample.specific_force_b
    filtered, last_force = m.filtered_rate_b, m.specific_force_b
    if not m.primed:
        m.primed = 1
        for i in range(3):
            last[i], last_force[i] = rate[i], force[i]
            filtered[i] = rate[i] - bias[i]
    filter_rate(m, rate, bias, g, dt)
    if m.initialized:
        x = 0.5 * (rate[0] + last[0]) - bias[0]
        y = 0.5 * (rate[1] + last[1]) - bias[1]
        z = 0.5 * (rate[2] + last[2]) - bias[2]
        start_w = acceleration_of(pose, last_force, m.accelerometer_bias_b)
        turn_pose(pose, x, y, z, g.norm_penalty, dt)
        end_w = acceleration_of(pose, force, m.accelerometer_bias_b)
        move_pose(pose, m.velocity_w, start_w, end_w, dt)
    m.stamp_ns = sample.stamp_ns
    remember(m)
    for i in range(3):
        last[i], last_force[i] = rate[i], force[i]
        out.position_w[i] = pose[i]
        out.velocity_w[i] = m.velocity_w[i]
        out.angular_velocity_b[i] = filtered[i]
    for i in range(4):
        out.quaternion_wb[i] = pose[3 + i]


@compiled
def predict(memory: Record, imu: Record, gains: Record, dt: float, state: Record) -> None:
    """Run `predict_one` for each of (N,) ESTIMATOR_MEMORY, IMU_SAMPLE, STATE; gains is (1,)."""
    for k in range(memory.shape[0]):
        predict_one(memory[k], imu[k], gains[0], dt, state[k])


@compiled(inner=True)
def correct_one(m: Item, z: Item, g: Item, out: Item) -> int:
    """Apply one pose to an initialized filter (eqs. 11 and 12, exact for the interval).

    Args:
        m: ESTIMATOR_MEMORY item.
        z: POSE_SAMPLE item.
        g: ESTIMATION_GAINS item.
        out: ESTIMATE item; innovations are written when there are any, refused or not.

    Returns an Outcome, which is counted.
    """
    outcome = _apply(m, z, g, out)
    m.outcomes[outcome] += 1
    return outcome


@compiled(inner=True)
def _apply(m: Item, z: Item, g: Item, out: Item) -> int:
    p, q, past, stamp_ns = z.position_w, z.quaternion_wb, m.past, z.stamp_ns
    norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    if not (math.isfinite(p[0] + p[1] + p[2]) and abs(norm2 - 1.0) < NORM_TOLERANCE):
        return _INVALID
    if stamp_ns <= m.newest_ns:
        return _NOT_NEWER
    if stamp_ns > m.stamp_ns + AHEAD_NS:
        return _AHEAD
    back = recall(m, stamp_ns)
    if back < 0:
        return _TOO_OLD
    e_w = (p[0] - past[0], p[1] - past[1], p[2] - past[2])
    turn_b = attitude_innovation(past, q)
    for i in range(3):
        out.position_innovation_w[i] = e_w[i]
        out.attitude_innovation_b[i] = turn_b[i]
    turn = multiply((past[3], -past[4], -past[5], -past[6]), normalized(quaternion(q)))
    if not passes(m, stamp_ns, e_w, chord2(turn), g):
        moves = refuse(m, stamp_ns, e_w, turn, g)
        m.newest_ns = stamp_ns
        around_x, around_y, around_z = rotation_vector(turn)
        store((around_x, around_y, around_z), out.attitude_innovation_b)  # which is large
        if moves:
            turn_w = to_world(past, 1.0, around_x, around_y, around_z)
            move_to(m, back, stamp_ns, e_w, turn_w)
            return _APPLIED
        return _OUTLIER
    interval = 1e-9 * (stamp_ns - m.pose_stamp_ns)
    m.pose_stamp_ns = m.newest_ns = stamp_ns

    l = translation_gains(  # noqa: E741 - L of the derivation there
        g.position_bandwidth, g.accelerometer_bias_bandwidth, interval
    )
    l_q, l_g = attitude_gains(g.attitude_bandwidth, g.gyroscope_bias_bandwidth, interval)
    turn_w = to_world(past, 1.0, l_q * turn_b[0], l_q * turn_b[1], l_q * turn_b[2])
    # b_dot = -R_wb^T Kb e: a missing acceleration means a bias that is too large.
    e_b = to_world(past, -1.0, e_w[0], e_w[1], e_w[2])
    amend(m, back, stamp_ns, e_w, l, turn_w)
    a_max, w_max = g.accelerometer_bias_limit, g.gyroscope_bias_limit
    a_bias, w_bias = m.accelerometer_bias_b, m.gyroscope_bias_b
    for i in range(3):
        a_bias[i] = min(max(a_bias[i] - l[2] * e_b[i], -a_max), a_max)
        w_bias[i] = min(max(w_bias[i] - l_g * turn_b[i], -w_max), w_max)
    m.position_spread += SPREAD * (dot(e_w, e_w) - m.position_spread)
    m.attitude_spread += SPREAD * (dot(turn_b, turn_b) - m.attitude_spread)
    return _APPLIED


@compiled
def correct(
    memory: Record, pose: Record, gains: Record, estimate: Record, outcome: npt.NDArray[np.int64]
) -> None:
    """Run `correct_one` for each of (N,) ESTIMATOR_MEMORY, POSE_SAMPLE, ESTIMATE; gains is (1,).

    outcome: (N,) of Outcome, written.
    """
    for k in range(memory.shape[0]):
        outcome[k] = correct_one(memory[k], pose[k], gains[0], estimate[k])


@compiled
def report(memory: Record, estimate: Record) -> None:
    """Write biases, measurement age and counts of (N,) ESTIMATOR_MEMORY into (N,) ESTIMATE."""
    for k in range(memory.shape[0]):
        m, out = memory[k], estimate[k]
        for i in range(3):
            out.accelerometer_bias_b[i] = m.accelerometer_bias_b[i]
            out.gyroscope_bias_b[i] = m.gyroscope_bias_b[i]
        out.measurement_age = math.inf
        if m.initialized:
            out.measurement_age = max(0.0, 1e-9 * (m.stamp_ns - m.pose_stamp_ns))
        out.agreement = m.agreement
        n = m.outcomes
        out.measurements_used, out.measurements_refused = n[_APPLIED], n[_OUTLIER]
        out.measurements_ignored = n[_TOO_OLD] + n[_NOT_NEWER] + n[_AHEAD] + n[_INVALID]
        out.nis, out.nis_freedom = math.nan, 0  # a filter of fixed gains has no covariance
        out.consistency = out.refused_share = math.nan
        out.accelerometer_noise_scale = out.gyroscope_noise_scale = math.nan
        out.measurement_noise_scale = math.nan
        for i in range(3):
            out.position_variance_w[i] = out.velocity_variance_w[i] = math.nan
            out.attitude_variance_w[i] = math.nan
