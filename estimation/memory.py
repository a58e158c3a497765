"""The memory of the complementary filter between ticks, one record per vehicle.

A pose is one array (7,): position_w (m), then quaternion_wb (w, x, y, z). They are kept together
because prediction, history and interpolation treat the seven numbers alike.
"""

from __future__ import annotations

import numpy as np

from estimation.outcome import Outcome
from quadrotor.records import Record

HISTORY_LENGTH = 256
"""Number of predicted poses kept for delayed measurements: 0.51 s at 500 Hz, 0.25 s at 1000 Hz."""

START_POSITION, START_ATTITUDE = 0.25, 0.3
"""Deviations of an innovation before any is known, m and rad."""

ESTIMATOR_MEMORY = np.dtype(
    [
        ("initialized", "u1"),  # a first pose was applied
        ("primed", "u1"),  # a first IMU sample was processed
        ("stamp_ns", "i8"),  # of the newest IMU sample
        ("pose_stamp_ns", "i8"),  # of the newest measured pose applied
        ("started_ns", "i8"),  # stamp of the first pose
        ("outcomes", "i8", len(Outcome)),  # measurements since the reset, by Outcome
        ("position_spread", "f8"),  # m^2, mean square innovation of the last dozen poses
        ("attitude_spread", "f8"),  # rad^2
        # The gate of `estimation.pose_gate`:
        ("newest_ns", "i8"),  # of the newest pose checked
        ("agreement", "i8"),  # an Agreement
        ("position_scale", "f8"),  # m^2, variance of an innovation on one axis
        ("attitude_scale", "f8"),  # rad^2
        ("distance", "f8"),  # of the newest pose used from its prediction, squared, in variances
        ("last_offset_w", "f8", 3),  # m, of the same pose
        ("last_turn", "f8"),  # rad
        ("jumped", "i8"),  # 1: the refused poses left the estimate at once
        ("run_count", "i8"),  # refused poses that agree with each other
        ("run_start_ns", "i8"),
        ("run_ns", "i8"),  # of the run's newest pose
        ("run_first_w", "f8", 3),  # m, of the run's first pose from the prediction
        ("run_offset_w", "f8", 3),  # m, of the run's newest pose
        ("run_turn", "f8", 4),  # from the predicted to the run's newest attitude, body axes
        ("pose", "f8", 7),  # the estimate
        ("past", "f8", 7),  # the estimate at the stamp of the newest measured pose
        ("velocity_w", "f8", 3),  # m/s
        ("filtered_rate_b", "f8", 3),  # rad/s
        ("notch_hz", "f8"),  # of the notch that `notch_b` belongs to; 0: none
        ("notch_b", "f8", (3, 2)),  # rad/s, its memory
        ("accelerometer_bias_b", "f8", 3),  # m/s^2
        ("gyroscope_bias_b", "f8", 3),  # rad/s
        ("specific_force_b", "f8", 3),  # m/s^2, the last sample, bias included
        ("rate_b", "f8", 3),  # rad/s, the last sample, bias included
        ("ring_next", "i8"),  # index of the next pose
        ("ring_count", "i8"),
        ("ring_stamp_ns", "i8", HISTORY_LENGTH),
        ("ring_pose", "f8", (HISTORY_LENGTH, 7)),
    ],
    align=True,
)


def new_memory(count: int = 1) -> Record:
    """Return `count` filters at the origin, level and at rest, waiting for a first pose."""
    memory = np.zeros(count, ESTIMATOR_MEMORY)
    memory["pose"][:, 3] = 1.0
    memory["position_scale"], memory["attitude_scale"] = START_POSITION**2, START_ATTITUDE**2
    return memory
