"""What the complementary filter remembers between ticks, one record a vehicle."""

from __future__ import annotations

import numpy as np

from quadrotor.records import Record

HISTORY_LENGTH = 256
"""Predicted poses kept for late measurements: 0.51 s at 500 Hz, 0.25 s at 1000 Hz."""

ESTIMATOR_MEMORY = np.dtype(
    [
        ("initialized", "u1"),  # a first pose was taken
        ("primed", "u1"),  # a first IMU sample was taken
        ("stamp_ns", "i8"),  # of the newest IMU sample
        ("pose_stamp_ns", "i8"),  # of the newest pose applied
        ("position_w", "f8", 3),  # m
        ("velocity_w", "f8", 3),  # m/s
        ("quaternion_wb", "f8", 4),
        ("filtered_rate_b", "f8", 3),  # rad/s
        ("accelerometer_bias_b", "f8", 3),  # m/s^2
        ("gyroscope_bias_b", "f8", 3),  # rad/s
        ("specific_force_b", "f8", 3),  # m/s^2, the last sample, bias included
        ("rate_b", "f8", 3),  # rad/s, the last sample, bias included
        ("past_position_w", "f8", 3),  # m, the estimate when the last pose was true
        ("past_quaternion_wb", "f8", 4),
        ("ring_next", "i8"),  # where the next pose goes
        ("ring_count", "i8"),
        ("ring_stamp_ns", "i8", HISTORY_LENGTH),
        ("ring_position_w", "f8", (HISTORY_LENGTH, 3)),
        ("ring_quaternion_wb", "f8", (HISTORY_LENGTH, 4)),
    ],
    align=True,
)


def new_memory(count: int = 1) -> Record:
    """`count` filters at the origin, level and at rest, waiting for a first pose."""
    memory = np.zeros(count, ESTIMATOR_MEMORY)
    memory["quaternion_wb"][:, 0] = 1.0
    return memory
