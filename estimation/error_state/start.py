"""Starts of the error-state filter: poses from measurements alone, and the initial memory."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from estimation.error_state.memory import ERRORS, SAMPLES
from estimation.outcome import Outcome
from estimation.poses.planar_pose import PlanarPose, planar_pose
from estimation.poses.sweep_pose import SweepPose, sweep_pose
from quadrotor.errors import DegenerateGeometryError, UndeterminedStartError
from quadrotor.records import POSE_SAMPLE, Array, Record
from quadrotor.rotations import quaternion_from_euler, rotate

START = np.repeat([0.05, math.radians(3.0), 0.5, 0.01, 0.1], 3)
"""Deviations at a start: m, rad, m/s (assumed at rest), rad/s, m/s^2."""
assert len(START) == ERRORS
DETERMINED = 4
"""Number of bearings to beacons in one plane that determine a unique pose."""
ONE_PLACE_NS = 60_000_000
"""Time in ns; sweeps of the planes within it met the vehicle at nearly one place, for a start."""
HEADING_SIGMA = math.radians(10.0)
"""Assumed deviation of the heading, in rad, of a vehicle on a marker alone."""
CALIBRATED = 0.001
"""Deviation, in rad/s, of the bias of a calibrated gyroscope: without measured attitudes, START's
would leave the heading open within seconds."""
HOW_TO_START = (
    "bring a fourth beacon in their plane into view, "
    "or run it as the shadow of an estimator on poses"
)


def pose_of_bearings(frame: np.void) -> PlanarPose:
    """Return the pose that a BEARINGS_SAMPLE item gives by itself. Raises MeasurementError,
    DegenerateGeometryError.
    """
    count = int(frame["count"])
    return planar_pose(frame["beacon_w"][:count], frame["bearing_b"][:count], frame["sigma"])


def start_by_bearings(frame: np.void) -> PlanarPose:
    """Return the start pose from one BEARINGS_SAMPLE item. Raises MeasurementError, and
    UndeterminedStartError when the bearings leave the pose open.
    """
    count = int(frame["count"])
    if count < DETERMINED:
        why = "up to four poses fit them" if count == 3 else "they leave the pose open"
        raise UndeterminedStartError(
            f"error_state cannot start on {count} bearings: {why}; {HOW_TO_START}"
        )
    try:
        return pose_of_bearings(frame)
    except DegenerateGeometryError as error:
        raise UndeterminedStartError(
            f"error_state cannot start on these bearings: {error}; {HOW_TO_START}"
        ) from error


def start_by_sweeps(newest: Iterable[Any], stamp_ns: int, plane_sigma: float) -> SweepPose:
    """Return the start pose at this time from each plane's newest SWEEPS_SAMPLE item. Raises
    UndeterminedStartError.

    Args:
        plane_sigma: rad, deviation common to the angles of a plane.
    """
    frames = [one for one in newest if one["stamp_ns"] > stamp_ns - ONE_PLACE_NS]
    try:
        return sweep_pose(frames, plane_sigma)
    except DegenerateGeometryError as error:
        raise UndeterminedStartError(
            f"error_state cannot start on these sweeps: {error}"
        ) from error


def start_at(frame: np.void, pose: Any, sigma: Array = START[6:9]) -> tuple[Record, Array]:
    """Return the POSE_SAMPLE (1,) and the deviations (15,) of a start at the pose of a frame.

    Args:
        sigma: m/s, deviations of the velocity.
    """
    sample = np.zeros(1, POSE_SAMPLE)
    sample[0] = frame["stamp_ns"], pose.position_w, pose.quaternion_wb
    deviations = START.copy()
    deviations[:6] = np.maximum(np.sqrt(np.diag(pose.covariance)), deviations[:6])
    deviations[6:9] = np.maximum(sigma, deviations[6:9])
    return sample, deviations


def start_on_marker(
    m: Record, marker_w: Array, noise: Record, deviations: Array, *, initialized: bool
) -> tuple[Array, Array, Array]:
    """Return position, quaternion and deviations of a start from a marker's position alone.

    The attitude is that of the initialized filter, else level by the newest specific force.

    Args:
        m: ERROR_STATE_MEMORY item.
        noise: its parameters, with the marker's place and the heading at the first start.
    """
    sigma = 0.0
    if initialized:
        quaternion, sigma = m["now"][6:10].copy(), math.sqrt(m["covariance"][5, 5])
    else:
        x, y, z = m["sample"][int(m["sample_next"] - 1) % SAMPLES, 3:]
        level = (math.atan2(y, z), math.atan2(-x, math.hypot(y, z)))
        quaternion = quaternion_from_euler(*level, float(noise["heading"]))
    deviations = deviations.copy()
    deviations[5], deviations[9:12] = max(sigma, HEADING_SIGMA), CALIBRATED
    marker_b = np.array([noise[f"marker_{axis}"] for axis in "xyz"])
    return marker_w - rotate(quaternion, marker_b), quaternion, deviations


def begin(
    m: Record,
    stamp_ns: int,
    position: Array,
    quaternion: Array,
    deviations: Array,
    velocity_w: Array | None,
) -> None:
    """Restart at a pose, with the present biases and their covariance.

    Args:
        m: ERROR_STATE_MEMORY item, written in place.
        position: (3,) m.
        quaternion: (4,), unit.
        deviations: (15,) of the error, in its order.
        velocity_w: (3,) m/s; at rest without one.
    """
    bias, biases_covariance = m["now"][10:].copy(), m["covariance"][9:, 9:].copy()
    x = m["base"]
    x[:3], x[6:10], x[10:] = position, quaternion, bias
    x[3:6] = 0.0 if velocity_w is None else velocity_w
    m["covariance"] = np.diag(deviations**2)
    if m["initialized"]:
        m["covariance"][9:, 9:] = biases_covariance
    m["measurement_ns"] = stamp_ns
    m["base_ns"] = min(stamp_ns, int(m["stamp_ns"])) if m["sample_count"] else stamp_ns
    m["now"] = x
    m["initialized"], m["consistency"], m["applied"], m["refused"] = 1, 1.0, 0, 0
    m["restarted"], m["freedom"], m["innovation"] = 0, 0, 0.0
    m["refused_share"], m["run_count"], m["last_unit"] = 0.0, 0, 0.0
    m["contradicted_ns"] = 0
    m["outcomes"][Outcome.APPLIED] += 1
    m["event_count"], m["event_order"][0], m["event_kind"][0] = 1, 0, 0
    m["event_ns"][0] = m["base_ns"]
    m["after_state"][0], m["after_covariance"][0] = x, m["covariance"]
