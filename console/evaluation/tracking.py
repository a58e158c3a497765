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
TRUE = ("truth", "tracker_pose", "tracker_position")
"""Topics of poses that count as true, the best first."""
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


@dataclass(frozen=True, slots=True)
class Compared:
    """True poses against the reference at their stamps, before any is left out.

    Attributes:
        topic: of the true poses, a name of TRUE.
        stamps: (N,) ns.
        position_w: (N, 3) m, true - reference.
        yaw: (N,) rad, the same, wrapped to -pi..pi.
        known: (N,) whether there is a reference at that time.
        far: (N,) whether a pose is far from the estimate.
    """

    topic: str
    stamps: Stamps
    position_w: Array
    yaw: Array
    known: npt.NDArray[np.bool_]
    far: npt.NDArray[np.bool_]

    def errors(self) -> TrackingErrors | None:
        """Return the errors that count; None without any."""
        count = len(self.stamps)
        is_measured = self.topic != "truth"
        sound = (
            ~self.far
            if is_measured and self.far.sum() <= MOST_FAR * count
            else np.ones_like(self.far)
        )
        counts = self.known & sound
        if not counts.any():
            return None
        return TrackingErrors(
            self.stamps[counts].astype(np.float64) * 1e-9,
            self.position_w[counts],
            self.yaw[counts],
            float((~sound).mean()) if is_measured else None,
        )


Rows = tuple[Stamps, Array]
"""Messages ordered by stamp, ns: stamps (N,), and the columns of WANTED after the stamp."""


def compare(topic: str, true: Rows, reference: Rows, state: Rows) -> Compared:
    """Compare the poses of a topic with the reference, and with the estimate; the rule for both is
    that of `console.evaluation.alignment.between`.
    """
    stamps, pose = true
    if topic == "tracker_pose":
        pose[:, 3:] /= np.linalg.norm(pose[:, 3:], axis=1, keepdims=True)
    elif topic == "tracker_position":
        pose = np.hstack([pose, np.full((len(pose), 4), np.nan)])
    far = np.zeros(len(stamps), bool)
    if topic != "truth":
        estimated_w, is_known = between(stamps, *state)
        far = is_known & ~(np.linalg.norm(pose[:, :3] - estimated_w, axis=1) <= FAR)
    given, rows = reference
    yaw = rows[:, 3]
    turns = np.column_stack([np.cos(yaw), np.sin(yaw)])
    wanted, known = between(stamps, given, np.hstack([rows[:, :3], turns]))
    w, x, y, z = pose[:, 3:].T
    yaw_error = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) - np.arctan2(
        wanted[:, 4], wanted[:, 3]
    )
    wrapped: Array = (yaw_error + np.pi) % (2 * np.pi) - np.pi
    return Compared(topic, stamps, pose[:, :3] - wanted[:, :3], wrapped, known, far)


def tracking_errors(log: Path, vehicle: str, start: float, end: float) -> TrackingErrors:
    """Return the errors of the flight in `log` for start <= t <= end (s, vehicle clock).

    Without truth, the tracker's poses count as truth, or else the positions of a marker, whose yaw
    errors are NaN. Single ones that are far from the estimate are left out: what the estimator
    refuses is an error of the tracker, not of the vehicle. Raises LogFormatError when they or the
    reference are missing.
    """
    found = read_topics(log, vehicle, WANTED, dtype=np.float64)
    topic = next((name for name in TRUE if len(found[name])), "truth")
    true, reference, state = (
        _rows(found[name], WANTED[name], start, end) for name in (topic, "reference", "state")
    )
    errors = compare(topic, true, reference, state).errors()
    if errors is None:
        raise LogFormatError(
            f"{log.name} has {len(true[0])} truth and {len(reference[0])} reference messages "
            f"between {start:.1f} s and {end:.1f} s, none at common times; was it flown to the end?"
        )
    return errors


def _rows(topic: Topic, names: tuple[str, ...], start: float, end: float) -> Rows:
    """Return the messages of a window (s)."""
    time = topic.publish_ns * 1e-9
    inside = (start <= time) & (time <= end)
    stamps, first = np.unique(topic.header_ns[inside], return_index=True)
    rows = topic.take(names)[inside][first].astype(np.float64, copy=False)
    return stamps, rows[:, len(HEADER_STAMP) :]
