"""The memory of the comparison of poses with the inertial sensors, for one vehicle.

The functions of this folder take one INTEGRITY_MEMORY record m.
"""

from __future__ import annotations

import math

import numpy as np

from quadrotor.records import Record

RING_LENGTH = 512
"""Number of IMU samples kept for delayed poses: 1.02 s at 500 Hz."""
START_TURN, START_PLACE = math.radians(1.0), 0.01
"""Deviations before any difference is known, rad and m."""
START_MOTORS, START_HEIGHT = 0.03, 0.2
"""Deviations of both witnesses before any difference is known, m."""

TURN, TILT, PLACE, LEVEL = range(4)
"""The tests: by the turn about all axes of the body, and about x and y alone; by the displacement
along all axes of the world, and along x and y alone."""

WITNESSED = np.dtype(
    [
        ("stamp_ns", "i8"),
        ("specific_force_b", "f8", 3),  # m/s²
        ("angular_velocity_b", "f8", 3),  # rad/s
        ("lift", "f8"),  # m/s², that the motors give along z_B
        ("height", "f8"),  # m, by the barometer
    ],
    align=True,
)
"""An IMU sample, and what the other witnesses said then."""

SINCE_POSE = np.dtype(
    [
        ("turn_b", "f8", 3),  # rad, by the gyroscope
        ("velocity_w", "f8", 3),  # m/s, change by the accelerometer, at the last pose's attitude
        ("place_w", "f8", 3),  # m, displacement that comes from it
        ("driven_velocity_w", "f8", 3),  # the same by the motors' lift
        ("driven_place_w", "f8", 3),
        ("height", "f8"),  # m, mean by the barometer
    ],
    align=True,
)
"""Motion that the IMU has measured since the last pose."""

INTEGRITY_MEMORY = np.dtype(
    [
        ("ring", WITNESSED, RING_LENGTH),
        ("ring_next", "i8"),  # number of samples so far
        ("lift", "f8"),  # m/s², that the motors give
        ("carried", "f8"),  # s for which they have carried the vehicle
        ("ground_pressure", "f8"),  # Pa
        ("rate_b", "f8", 3),  # rad/s, by the motors' torques, and the gyroscope while it measures
        ("push_b", "f8", 3),  # rad/s², angular acceleration by those torques
        ("push_offset_b", "f8", 3),  # rad/s², by others
        ("reading_b", "f8", 3),  # rad/s, the newest
        ("unchanged", "f8", 3),  # s for which it has stayed the same
        ("stuck", "i8", 3),  # 1: the axis is stuck
        ("turn_rate_b", "f8", 3),  # rad/s, by the tracker
        ("driven_b", "f8", 3),  # rad/s, by the torques since it last followed the gyroscope
        ("felt", SINCE_POSE),
        ("stamp_ns", "i8"),  # of the newest pose compared, 0 before the first
        ("settled", "f8"),  # s since the start of the filters
        ("learnt", "f8"),  # s for which means and variances were learnt
        ("doubted", "f8"),  # s for which the evidence has been large
        ("tips", "i8"),  # number of outliers in a row that suddenly show another attitude
        ("jump_b", "f8", 4),  # rotation, body axes, from the attitude that is felt to that one
        ("tipped", "i8"),  # 1: the tracker's attitude has jumped in flight
        ("quaternion_wb", "f8", 4),  # of the newest pose
        ("position_w", "f8", 3),  # m
        ("height", "f8"),  # m, by the barometer, at that pose
        # High-passed, with the filters' second state:
        ("turn_shown_b", "f8", 6),  # rad, by the tracker
        ("turn_felt_b", "f8", 6),  # rad, by the gyroscope
        ("quick_shown_b", "f8", 6),  # rad, both without what a bias adds
        ("quick_felt_b", "f8", 6),
        ("place_shown_w", "f8", 6),  # m, by the tracker
        ("place_felt_w", "f8", 6),  # m, by the accelerometer
        ("place_driven_w", "f8", 6),  # m, by the motors
        ("place_height_w", "f8", 6),  # m, by the barometer, z alone
        ("place_offset_w", "f8", 3),  # m, mean of g - t
        ("driven_offset_w", "f8", 3),  # m, the same of the motors
        ("turn_variance", "f8"),  # rad², of a difference on one axis
        ("place_variance", "f8"),  # m²
        ("driven_variance", "f8"),  # m², of the motors
        ("height_variance", "f8"),  # m², of the barometer
        ("motion", "f8", 4),  # rad² or m², mean of |g|², by the test
        ("evidence", "f8", 4),  # by the test
        ("vote", "f8"),  # for the tracker, below 0 for the accelerometer
        ("agreement", "f8", 3),  # of quick turns about each axis, below 0 for a contradiction
        ("overruled", "i8", 2),  # number of alarms by turns and by displacements dismissed
        ("fitted", "f8"),  # s, for which the slopes were fitted
        ("late", "f8", 2),  # rad², means of (g - t)·rate, in s, and of |rate|², in 1/s²
        ("size", "f8", 2),  # m² s, by how much positions are too large, and t·g, both summed up
        ("size_offset_h", "f8", 3),  # m, mean of g - t along the heading, for these
    ],
    align=True,
)


OF_TICKS = (
    *("ring", "ring_next", "lift", "carried", "ground_pressure", "rate_b", "push_b"),
    *("push_offset_b", "reading_b", "unchanged", "stuck", "driven_b"),
)
"""The fields that poses do not change, or only for a moment."""


def new_integrity() -> Record:
    """Return INTEGRITY_MEMORY (1,) before the first sample."""
    m = np.zeros(1, INTEGRITY_MEMORY)
    m["turn_variance"], m["place_variance"] = START_TURN**2, START_PLACE**2
    m["driven_variance"], m["height_variance"] = START_MOTORS**2, START_HEIGHT**2
    return m
