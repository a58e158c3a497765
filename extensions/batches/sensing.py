"""Simulated measurements for the vehicle's filters: quantised IMU samples and late, noisy poses."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bearing_sim.tracker import TrackerParameters
from estimation.complementary_filter import correct_one
from extensions.batches.noise import normals, uniform
from quadrotor.compiled import compiled
from quadrotor.errors import OutOfBoundsError
from quadrotor.records import POSE_SAMPLE, Item, Record
from quadrotor.vectors import turned
from vehicle.simulator.sensors import (
    ACCELEROMETER_SCALE,
    GYROSCOPE_SCALE,
    ZERO,
    accelerometer_count,
    gyroscope_count,
    sensed_force,
)

UNDER_WAY = 16
"""Largest number of poses that can be between the tracker and the vehicle at one time."""

TRACKER = np.dtype(
    [
        ("interval_ns", "i8"),
        ("delay_ns", "i8"),
        ("position_noise", "f8"),  # m
        ("attitude_noise", "f8"),  # rad
        ("drop_out", "f8"),  # share of poses lost
        ("next_ns", "i8"),  # time of the next pose
        ("taken", "i8"),  # number of poses so far
        ("given", "i8"),  # number of these that have arrived
        ("pose", POSE_SAMPLE, UNDER_WAY),
    ],
    align=True,
)


def new_tracker(parameters: TrackerParameters) -> Record:
    """Return a TRACKER record, shape (1,).

    Raises OutOfBoundsError when the delay covers too many poses.
    """
    p = parameters
    if p.delay * p.rate > UNDER_WAY - 1:
        raise OutOfBoundsError(
            f"a tracker of {p.rate:g} Hz delayed by {p.delay:g} s has {p.delay * p.rate:.0f} poses "
            f"under way, at most {UNDER_WAY - 1} are kept: lower the rate or the delay"
        )
    out = np.zeros(1, TRACKER)
    out["interval_ns"] = round(1e9 / p.rate)
    out["delay_ns"] = round(p.delay * 1e9)
    out["position_noise"], out["attitude_noise"] = p.position_noise, math.radians(p.attitude_noise)
    out["drop_out"] = p.drop_out
    return out


@compiled(inner=True)
def read_imu(p: Item, s: Item, bias_b: Any, random: Any, drawn: Any, imu: Item) -> None:
    """Write the IMU_SAMPLE of a PLANT record by SENSORS s, less the known gyroscope bias.

    Args:
        bias_b: (3,) rad/s.
        drawn: (6,), buffer for the random numbers, drawn in a loop to compile their code only once.
    """
    normals(random, drawn)
    for i in range(3):
        count = accelerometer_count(
            sensed_force(s.accelerometer_matrix, p.specific_force_b, i),
            s.accelerometer_bias[i],
            s.accelerometer_noise,
            drawn[i],
            s.accelerometer_range,
        )
        imu.specific_force_b[i] = ACCELEROMETER_SCALE * (count - ZERO)
        count = gyroscope_count(
            p.x[10 + i], s.gyroscope_bias[i], s.gyroscope_noise, drawn[3 + i], s.gyroscope_range
        )
        imu.angular_velocity_b[i] = GYROSCOPE_SCALE * (count - ZERO) - bias_b[i]


@compiled(inner=True)
def track(
    t: Item, p: Item, stamp_ns: int, random: Any, drawn: Any, memory: Item, gains: Item, out: Item
) -> None:
    """Measure a pose of a PLANT record when one is due; pass the poses that arrived to the filter.

    Args:
        t: TRACKER.
        drawn: (6,), buffer for random numbers.
        memory, gains, out: ESTIMATOR_MEMORY, ESTIMATION_GAINS and ESTIMATE of the filter.
    """
    if stamp_ns >= t.next_ns:
        t.next_ns += t.interval_ns
        # Drawn for lost poses too, so that drop-outs do not shift the noise of the others.
        normals(random, drawn)
        if not uniform(random) < t.drop_out:
            z, x, n = t.pose[t.taken % UNDER_WAY], p.x, t.attitude_noise
            t.taken += 1
            z.stamp_ns = stamp_ns
            for i in range(3):
                z.position_w[i] = x[i] + t.position_noise * drawn[i]
            q, phi = z.quaternion_wb, (n * drawn[3], n * drawn[4], n * drawn[5])
            q[0], q[1], q[2], q[3] = turned((x[6], x[7], x[8], x[9]), phi)
    while t.given < t.taken:
        z = t.pose[t.given % UNDER_WAY]
        if z.stamp_ns + t.delay_ns > stamp_ns:
            return
        t.given += 1
        correct_one(memory, z, gains, out)
