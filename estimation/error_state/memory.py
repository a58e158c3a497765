"""The memory of the error-state filter between ticks, one record per vehicle.

A nominal state is one array (16,): position_w (m), velocity_w (m/s), quaternion_wb, gyroscope bias
(rad/s), accelerometer bias (m/s^2). The error has 15 components, in this order:

    0:3   position, true - estimated, m, world axes
    3:6   attitude phi, R_true = exp(phi) R_estimated, rad, world axes
    6:9   velocity, m/s, world axes
    9:12  gyroscope bias, rad/s, body axes
    12:15 accelerometer bias, m/s^2, body axes

Measurements depend on the first six only, so these come first.
"""

from __future__ import annotations

import numpy as np

from estimation.outcome import Outcome
from quadrotor.records import MAX_BEACONS, Record

ERRORS = 15
POSE_ERRORS = 6
NOMINAL = 16
SAMPLES = 1024
"""Number of IMU samples kept for delayed measurements (a power of two): LATEST_NS at 1000 Hz, and
the time from the event before."""
EVENTS = 384
"""Number of measurements kept, each with the filter after it: LATEST_NS of poses at 500 Hz and of
bearings at 120 Hz, the highest rates of the sensors."""
ROWS = 2 * MAX_BEACONS
PLANE_ROWS = 2

NOTHING, POSE, BEARINGS, SWEEPS, MARKER, READING = range(6)
"""Kinds of an event. NOTHING only propagates the filter to its time; a READING, of a sensor of the
user's own, corrects it, but is no evidence for or against it."""
READING_ROWS = 3

FORCE, RATE, POSITION, ATTITUDE, BEARING = range(5)
"""Noises whose variance is adapted: of accelerometer, gyroscope, poses, bearings or sweeps."""
NOISES = 5

ERROR_STATE_MEMORY = np.dtype(
    [
        ("initialized", "u1"),
        ("stamp_ns", "i8"),  # of the newest IMU sample
        ("measurement_ns", "i8"),  # of the newest measurement within the gate
        ("now", "f8", NOMINAL),  # nominal state at stamp_ns
        ("filtered_rate_b", "f8", 3),  # rad/s
        ("notch_hz", "f8"),  # of the notch that `notch_b` belongs to; 0: none
        ("notch_b", "f8", (3, 2)),  # rad/s, its memory
        # The filter proper, as of the newest event.
        ("base_ns", "i8"),
        ("base", "f8", NOMINAL),
        ("covariance", "f8", (ERRORS, ERRORS)),
        ("sample_next", "i8"),
        ("sample_count", "i8"),
        ("sample_ns", "i8", SAMPLES),
        ("sample", "f8", (SAMPLES, 6)),  # rate (rad/s), specific force (m/s^2)
        # A measurement about to be applied. Data of bearings: one row each, beacon_w (m) then
        # bearing_b; of a pose: position_w in the first row, quaternion_wb in the second, which a
        # marker does not have; of sweeps: the plane in the first PLANE_ROWS, then one row each,
        # sensor_b and angle; of a reading: position_w and rest, quaternion_wb, the gradient.
        ("new_ns", "i8"),
        ("new_kind", "i8"),
        ("new_count", "i8"),
        ("new_sigma", "f8"),  # rad
        ("new_data", "f8", (MAX_BEACONS, 6)),
        # Measurements in the order of their stamps, each with the filter after it.
        ("event_count", "i8"),
        ("event_order", "i8", EVENTS),  # slots, oldest first
        ("event_ns", "i8", EVENTS),
        ("event_kind", "i8", EVENTS),
        ("event_beacons", "i8", EVENTS),
        ("event_sigma", "f8", EVENTS),
        ("event_data", "f8", (EVENTS, MAX_BEACONS, 6)),
        ("after_state", "f8", (EVENTS, NOMINAL)),
        ("after_covariance", "f8", (EVENTS, ERRORS, ERRORS)),
        # Results of the measurement that arrived last.
        ("innovation", "f8", POSE_ERRORS),  # before the correction: m, rad, in world axes
        ("reading", "f8", 2),  # of a reading, in its unit: innovation, and the least refused
        ("freedom", "i8"),  # numbers that were used: 2 a bearing, 6 a pose, 3 a marker; 0: refused
        ("nis", "f8"),  # normalised innovation squared, of `freedom` degrees
        ("consistency", "f8"),  # mean of nis / freedom over the last few dozen
        ("refused_share", "f8"),  # of the last few dozen measurements
        ("contradicted_ns", "i8"),  # since when that has been most of them; 0: it is not
        ("applied", "i8"),  # since the start
        ("refused", "i8"),  # since one was within the gate
        ("refused_ns", "i8"),  # stamp of the first of them
        ("believed", "u1"),  # the newest one was within the gate
        ("at_once", "u1"),  # the first of them followed closely after an applied one
        ("restarted", "u1"),  # after refused measurements, and not consistent since
        ("outcomes", "i8", len(Outcome)),  # measurements since the reset, by Outcome
        # Adapted noise, by `adaptation`, in the order of FORCE to BEARING.
        ("noise_scale", "f8", NOISES),  # factor on the stated variance
        ("evidence", "f8", NOISES),  # for the factor
        ("last_ns", "i8"),
        ("last_unit", "f8", POSE_ERRORS),  # innovation at that time in deviations, bounded
        # Refused poses that agree with each other, by `estimation.error_state.gate`.
        ("run_count", "i8"),
        ("run_start_ns", "i8"),
        ("run_ns", "i8"),  # of the newest
        ("run_first", "f8", POSE_ERRORS),  # innovation of the first: m, rad, world axes
        ("run_last", "f8", POSE_ERRORS),  # of the newest
        # Working memory.
        ("used", "u1", MAX_BEACONS),  # pairs of rows that passed the gate
        ("step", "f8", ERRORS),  # the correction
        ("row", "f8", (ROWS, POSE_ERRORS)),  # Jacobian of each measured number
        ("rest", "f8", ROWS),  # its residual
        ("variance", "f8", ROWS),
        ("expected", "f8", ROWS),  # variance of the residual by prior and measurement
        ("far", "f8"),  # least distance that is refused
        ("doubt", "f8", ROWS),  # variance added for its distance from the prediction
        ("distance", "f8", MAX_BEACONS),  # of a pair of rows from its prediction, chi-square of 2
        ("plane", "f8", 6 * PLANE_ROWS),
        ("prior", "f8", (ERRORS, ERRORS)),
        ("trial", "f8", NOMINAL),
        ("found", "f8", ERRORS),
        ("gain", "f8", (2, ERRORS)),
    ],
    align=True,
)


def new_memory(count: int = 1) -> Record:
    """Return `count` filters at the origin, level and at rest, waiting for a first pose."""
    memory = np.zeros(count, ERROR_STATE_MEMORY)
    memory["now"][:, 6] = memory["base"][:, 6] = 1.0
    memory["consistency"] = 1.0
    memory["noise_scale"] = 1.0
    return memory
