"""Tracking errors from a log: `truth` against `reference`, both at the stamps of truth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from console.evaluation.alignment import between
from console.evaluation.figures import rms
from flight_log.columns.log_columns import read_topics
from flight_log.columns.topic import Topic
from flight_log.fields import ATTITUDE, MARKED, POSITION, REFERENCE, TRACKED, TRACKED_ATTITUDE
from flight_log.payload_layout import HEADER_STAMP
from quadrotor.errors import LogFormatError
from quadrotor.records import Array, Stamps

WANTED = {
    "truth": (*HEADER_STAMP, *POSITION, *ATTITUDE),
    "tracker_pose": (*HEADER_STAMP, *TRACKED, *TRACKED_ATTITUDE),
    "tracker_position": (*HEADER_STAMP, *MARKED),
    "reference": (*HEADER_STAMP, *REFERENCE, "yaw"),
    "state": (*HEADER_STAMP, *POSITION),
}
FAR = 0.06
"""Distance, in m, of a tracked position from the estimate, beyond which the estimator refuses it at
the earliest (`estimation.pose_gate`)."""
MOST_FAR = 0.4
"""Share of such positions above which the estimate is in doubt, and not the tracker."""


@dataclass(frozen=True, slots=True)
class TrackingErrors:
    """Errors truth - reference at the stamps of truth, within a window.

    Attributes:
        time: (N,) s.
        position_w: (N, 3) m.
        yaw: (N,) rad, wrapped to -pi..pi.
        left_out: share of the tracker's poses that are errors of the tracker, 0 to 1; None where
            the truth is known.
    """

    time: Array
    position_w: Array
    yaw: Array
    left_out: float | None = None

    def metrics(self) -> dict[str, float]:
        """Return rms and largest position error (m), rms yaw error (deg), number of samples, and
        the share of left out poses where they stand for the truth.
        """
        distance = np.linalg.norm(self.position_w, axis=1)
        metrics = {
            "position_rms_m": rms(distance),
            "position_max_m": float(distance.max()),
            "yaw_rms_deg": math.degrees(rms(self.yaw)),
            "samples": float(len(distance)),
        }
        return metrics if self.left_out is None else metrics | {"poses_left_out": self.left_out}


def tracking_errors(log: Path, vehicle: str, start: float, end: float) -> TrackingErrors:
    """Return the errors of the flight in `log` for start <= t <= end (s, vehicle clock).

    Without truth, the tracker's poses count as truth, or else the positions of a marker, whose yaw
    errors are NaN. Single ones that are far from the estimate are left out: what the estimator
    refuses is an error of the tracker, not of the vehicle. Raises LogFormatError when they or the
    reference are missing.
    """
    found = read_topics(log, vehicle, WANTED, dtype=np.float64)
    true = ("truth", "tracker_pose", "tracker_position")
    topic = next((name for name in true if len(found[name])), "truth")
    stamps, pose = _rows(found[topic], WANTED[topic], start, end)
    if topic == "tracker_pose":
        pose[:, 5:] /= np.linalg.norm(pose[:, 5:], axis=1, keepdims=True)
    elif topic == "tracker_position":
        pose = np.hstack([pose, np.full((len(pose), 4), np.nan)])
    sound = np.ones(len(stamps), bool)
    if topic != "truth":
        sound = _near_the_estimate(stamps, pose, _rows(found["state"], WANTED["state"], start, end))
    given, reference = _rows(found["reference"], WANTED["reference"], start, end)
    yaw = reference[:, 5]
    turns = np.column_stack([np.cos(yaw), np.sin(yaw)])
    wanted, known = between(stamps, given, np.hstack([reference[:, 2:5], turns]))
    known &= sound
    if not known.any():
        raise LogFormatError(
            f"{log.name} has {len(stamps)} truth and {len(given)} reference messages between "
            f"{start:.1f} s and {end:.1f} s, none at common times; was it flown to the end?"
        )
    position_w, (w, x, y, z) = pose[known, 2:5], pose[known, 5:].T
    wanted = wanted[known]
    yaw_error = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) - np.arctan2(
        wanted[:, 4], wanted[:, 3]
    )
    wrapped: Array = (yaw_error + np.pi) % (2 * np.pi) - np.pi
    return TrackingErrors(
        stamps[known].astype(np.float64) * 1e-9,
        position_w - wanted[:, :3],
        wrapped,
        None if topic == "truth" else float((~sound).mean()),
    )


def _near_the_estimate(
    stamps: Stamps, pose: Array, estimate: tuple[Stamps, Array]
) -> npt.NDArray[np.bool_]:
    """Return which poses (N,) are near the estimate or without one; all, when many are not."""
    given, state = estimate
    estimated_w, known = between(stamps, given, state[:, 2:5])
    far = known & ~(np.linalg.norm(pose[:, 2:5] - estimated_w, axis=1) <= FAR)
    return ~far if far.sum() <= MOST_FAR * len(far) else np.ones(len(stamps), bool)


def _rows(topic: Topic, names: tuple[str, ...], start: float, end: float) -> tuple[Stamps, Array]:
    """Return the messages of a window (s), ordered by stamp: the stamps, (N,), and the numbers."""
    time = topic.publish_ns * 1e-9
    inside = (start <= time) & (time <= end)
    stamps, first = np.unique(topic.header_ns[inside], return_index=True)
    return stamps, topic.take(names)[inside][first].astype(np.float64, copy=False)
