"""The error-state filter on its memory: predict, store a measurement, apply it.

Item functions take the records of one vehicle, the others all of (N,).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from estimation.error_state.memory import (
    ATTITUDE,
    BEARING,
    BEARINGS,
    FORCE,
    MARKER,
    NOTHING,
    PLANE_ROWS,
    POSE,
    POSITION,
    RATE,
    READING,
    READING_ROWS,
    SAMPLES,
    SWEEPS,
)
from estimation.error_state.motion import move
from estimation.error_state.timeline import apply_one
from estimation.error_state.update import LOST_REFUSALS
from estimation.outcome import NORM_TOLERANCE, Agreement, Outcome
from estimation.rate_filter import filter_rate
from estimation.sweep_angles import plane_numbers
from quadrotor.compiled import compiled
from quadrotor.records import (
    BEARINGS_SAMPLE,
    MAX_BEACONS,
    MAX_SENSORS,
    POSE_SAMPLE,
    READING_SAMPLE,
    Array,
    Item,
    Record,
)
from quadrotor.vectors import add, axes_of, scale, to_body, vector

_MASK = SAMPLES - 1
_APPLIED, _TOO_OLD, _NOT_NEWER, _AHEAD, _INVALID, _OUTLIER = (int(o) for o in Outcome)
_USED, _REFUSED, _JUMPED, _DRIFTED, _MOVED = (int(a) for a in Agreement)


@compiled(inner=True)
def predict_one(m: Item, sample: Item, g: Item, dt: float, out: Item) -> None:
    """Advance one filter by one IMU sample.

    Args:
        m: ERROR_STATE_MEMORY item.
        sample: IMU_SAMPLE item.
        g: ERROR_STATE_NOISE item.
        dt: s since the last sample, for the low-pass; everything else uses stamps.
        out: STATE item, written.
    """
    x, new, old = m.now, m.sample[m.sample_next], m.sample[(m.sample_next - 1) & _MASK]
    step = 1e-9 * (sample.stamp_ns - m.stamp_ns)
    for i in range(3):
        new[i], new[3 + i] = sample.angular_velocity_b[i], sample.specific_force_b[i]
    if m.sample_count == 0:
        step = 0.0
        for i in range(3):
            m.filtered_rate_b[i] = new[i] - x[10 + i]
        if m.initialized:  # by a pose before the first sample: it counts from now
            m.base_ns = m.event_ns[0] = sample.stamp_ns
    m.stamp_ns = m.sample_ns[m.sample_next] = sample.stamp_ns
    m.sample_next = (m.sample_next + 1) & _MASK
    m.sample_count = min(m.sample_count + 1, SAMPLES)
    filter_rate(m, new, x[10:], g, dt)
    if m.initialized and step > 0.0:
        rate = scale(0.5, add(vector(old), vector(new)))
        move(x, vector(old[3:]), vector(new[3:]), rate, step)
    for i in range(3):
        out.position_w[i], out.velocity_w[i] = x[i], x[3 + i]
        out.angular_velocity_b[i] = m.filtered_rate_b[i]
    for i in range(4):
        out.quaternion_wb[i] = x[6 + i]


def take(m: Item, measurement: Record) -> bool:
    """Store a sample (1,) of any kind as the new measurement; return False when it is invalid."""
    item = measurement[0]
    if measurement.dtype == POSE_SAMPLE:
        return bool(take_pose(m, item))
    if measurement.dtype == BEARINGS_SAMPLE:
        return bool(take_bearings(m, item))
    if measurement.dtype == READING_SAMPLE:
        return bool(take_reading(m, item))
    return bool(take_sweeps(m, item, plane_numbers(item)))


@compiled
def take_pose(m: Item, z: Item) -> bool:
    """Store a POSE_SAMPLE item, with or without attitude, as the new measurement; return False when
    it is invalid.
    """
    p, q = z.position_w, z.quaternion_wb
    m.new_ns, m.new_kind, m.new_count = z.stamp_ns, POSE, 2
    n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    for i in range(3):
        m.new_data[0, i] = p[i]
    if n == 0.0:
        m.new_kind, m.new_count = MARKER, 1
        return math.isfinite(p[0] + p[1] + p[2])
    for i in range(4):
        m.new_data[1, i] = q[i] / math.sqrt(n)
    return math.isfinite(p[0] + p[1] + p[2]) and abs(n - 1.0) < NORM_TOLERANCE


@compiled
def take_bearings(m: Item, z: Item) -> bool:
    """Store a BEARINGS_SAMPLE item as the new measurement; return False when it is invalid."""
    m.new_ns, m.new_kind, m.new_count, m.new_sigma = z.stamp_ns, BEARINGS, z.count, z.sigma
    if not (1 <= z.count <= MAX_BEACONS and z.sigma > 0.0):
        return False
    valid = math.isfinite(z.sigma)
    for k in range(z.count):
        n = 0.0
        for i in range(3):
            n += z.bearing_b[k, i] ** 2 + 0.0 * z.beacon_w[k, i]  # NaN when either is not finite
        for i in range(3):
            m.new_data[k, i] = z.beacon_w[k, i]
            m.new_data[k, 3 + i] = z.bearing_b[k, i] / math.sqrt(n)
        valid = valid and abs(n - 1.0) < NORM_TOLERANCE
    return valid


@compiled
def take_sweeps(m: Item, z: Item, plane: Array) -> bool:
    """Store a SWEEPS_SAMPLE item as the new measurement; return False when it is invalid.

    Args:
        plane: (12,), the numbers of its plane.
    """
    m.new_ns, m.new_kind, m.new_count, m.new_sigma = z.stamp_ns, SWEEPS, PLANE_ROWS, z.sigma
    if not (1 <= z.count <= MAX_SENSORS and z.sigma > 0.0):
        return False
    m.new_count += z.count
    total = z.sigma
    for i in range(6 * PLANE_ROWS):
        m.new_data[i // 6, i % 6] = plane[i]
        total += plane[i]
    for k in range(z.count):
        row = m.new_data[PLANE_ROWS + k]
        for i in range(3):
            row[i] = z.sensor_b[k, i]
            total += row[i]
        row[3] = z.angle[k]
        total += row[3]
    n = plane[3] ** 2 + plane[4] ** 2 + plane[5] ** 2 + plane[6] ** 2
    return math.isfinite(total) and abs(n - 1.0) < NORM_TOLERANCE


@compiled
def take_reading(m: Item, z: Item) -> bool:
    """Store a READING_SAMPLE item as the new measurement; return False when it is invalid."""
    m.new_ns, m.new_kind, m.new_count, m.new_sigma = z.stamp_ns, READING, READING_ROWS, z.sigma
    total, n = z.sigma + z.rest, 0.0
    for i in range(6):
        m.new_data[2, i] = z.row[i]
        total += z.row[i]
    for i in range(3):
        m.new_data[0, i] = z.position_w[i]
        total += z.position_w[i]
    m.new_data[0, 3] = z.rest
    for i in range(4):
        m.new_data[1, i] = z.quaternion_wb[i]
        n += z.quaternion_wb[i] ** 2
    return math.isfinite(total) and z.sigma > 0.0 and abs(n - 1.0) < NORM_TOLERANCE


@compiled
def take_nothing(m: Item) -> None:
    """Store an event without a measurement at the newest sample; needed before the samples since
    the last event are overwritten.
    """
    m.new_ns, m.new_kind, m.new_count = m.stamp_ns, NOTHING, 0


@compiled
def report(memory: Record, estimate: Record) -> None:
    """Write biases, the result of the newest measurement, and variances after the newest event in
    time.

    Args:
        memory: (N,) ERROR_STATE_MEMORY.
        estimate: (N,) ESTIMATE, written.
    """
    for k in range(memory.shape[0]):
        m, out, n = memory[k], estimate[k], memory[k].outcomes
        x, P = m.now, m.covariance
        turn_b = to_body(axes_of((x[6], x[7], x[8], x[9])), vector(m.innovation[3:]))
        known = m.initialized == 1
        for i in range(3):
            out.gyroscope_bias_b[i] = x[10 + i]
            out.accelerometer_bias_b[i] = x[13 + i]
            out.position_innovation_w[i] = m.innovation[i]
            out.attitude_innovation_b[i] = turn_b[i]
            out.position_variance_w[i] = P[i, i] if known else math.nan
            out.attitude_variance_w[i] = P[3 + i, 3 + i] if known else math.nan
            out.velocity_variance_w[i] = P[6 + i, 6 + i] if known else math.nan
        out.nis = m.nis if m.freedom > 0 else math.nan
        out.nis_freedom = m.freedom
        out.consistency, out.refused_share = m.consistency, m.refused_share
        factors = m.noise_scale
        out.accelerometer_noise_scale = math.sqrt(factors[FORCE])
        out.gyroscope_noise_scale = math.sqrt(factors[RATE])
        measured = max(factors[POSITION], factors[ATTITUDE], factors[BEARING])
        out.measurement_noise_scale = math.sqrt(measured)
        out.measurement_age = math.inf
        if known:
            out.measurement_age = max(0.0, 1e-9 * (m.stamp_ns - m.measurement_ns))
        out.measurements_used, out.measurements_refused = n[_APPLIED], n[_OUTLIER]
        out.measurements_ignored = n[_TOO_OLD] + n[_NOT_NEWER] + n[_AHEAD] + n[_INVALID]
        if m.refused >= LOST_REFUSALS:
            out.agreement = _JUMPED if m.at_once else _DRIFTED
        elif m.refused:
            out.agreement = _REFUSED
        else:
            out.agreement = _MOVED if m.restarted else _USED


@compiled
def predict(memory: Record, imu: Record, noise: Record, dt: float, state: Record) -> None:
    """Run `predict_one` for each of (N,) ERROR_STATE_MEMORY, IMU_SAMPLE, STATE; noise is (1,)."""
    for k in range(memory.shape[0]):
        predict_one(memory[k], imu[k], noise[0], dt, state[k])


@compiled(inner=True)
def apply(memory: Record, noise: Record, outcome: npt.NDArray[np.int64]) -> None:
    """Run `apply_one` for each of (N,) ERROR_STATE_MEMORY; outcome (N,) of Outcome, written."""
    for k in range(memory.shape[0]):
        outcome[k] = apply_one(memory[k], noise[0])
