"""The data of a flight from its log on common times: truth, estimate, reference and errors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from console.evaluation.alignment import between, roll_pitch_yaw, rotated_rows
from console.reports.run_log import RunLog
from flight_log.fields import ODOMETRY, REFERENCE, TRACKED, TRACKED_ATTITUDE
from quadrotor.plain_rotations import make_continuous

Array = npt.NDArray[np.floating]

LARGEST_GAP = 0.1
"""Longest gap between messages that is interpolated, s."""
WANTED = (*REFERENCE, "yaw")


@dataclass(frozen=True)
class Track:
    """A track of positions: position_w (m), angles (rad), velocity_w (m/s, NaN when unknown)."""

    name: str
    time: Array  # (N,) s
    position_w: Array  # (N, 3)
    quaternion_wb: Array  # (N, 4)
    velocity_w: Array  # (N, 3)

    @cached_property
    def angles(self) -> Array:
        """Return (N, 3) roll, pitch, yaw."""
        return roll_pitch_yaw(self.quaternion_wb)


@dataclass(frozen=True)
class Flight:
    """The columns of one log on common times; None where the log has no such data.

    Attributes:
        truth: the simulator's, else the tracker's.
        estimate: the estimate in use, at the times of the truth where there is one.
        reference: (N, 4) position_w and yaw at the times of `shown`.
    """

    truth: Track | None
    estimate: Track | None
    reference: Array

    @property
    def shown(self) -> Track | None:
        """Return the best available track of the vehicle."""
        return self.truth or self.estimate

    @cached_property
    def tracking_error(self) -> tuple[Array, Array]:
        """Return the errors of position (N, 3) m and yaw (N,) rad at the times of `shown`:
        measured minus reference.
        """
        shown = self.shown
        if shown is None:
            return np.zeros((0, 3)), np.zeros(0)
        wanted = self.reference
        return shown.position_w - wanted[:, :3], wrapped(shown.angles[:, 2] - wanted[:, 3])

    @cached_property
    def estimation_error(self) -> tuple[Array, Array, Array]:
        """Return the estimate's errors of position (m), velocity (m/s) and angles (rad), each
        (N, 3): truth minus estimate.
        """
        truth, known = self.truth, self.estimate
        if truth is None or known is None:
            nothing = np.zeros((0, 3))
            return nothing, nothing, nothing
        return (
            truth.position_w - known.position_w,
            truth.velocity_w - known.velocity_w,
            wrapped(truth.angles - known.angles),
        )


def flight_of(log: RunLog) -> Flight:
    """Return the flight from the log's columns; those of state and reference are freed."""
    truth = _odometry(log, "truth", "truth")
    if truth is None and log.has("tracker_pose"):
        series = log.topics["tracker_pose"]
        rows = series.rows(TRACKED + TRACKED_ATTITUDE)
        nowhere = np.full((len(rows), 3), np.nan)
        truth = Track("tracker", series.time, rows[:, :3], rows[:, 3:], nowhere)
    estimate = _odometry(log, "state", "estimate", None if truth is None else truth.time)
    shown = truth or estimate
    time = shown.time if shown is not None else np.zeros(0)
    wanted = np.full((len(time), len(WANTED)), np.nan)
    if log.has("reference"):
        series = log.topics["reference"]
        wanted = between(time, series.time, series.take(WANTED), LARGEST_GAP)[0]
    return Flight(truth, estimate, wanted)


def wrapped(angle: Array) -> Array:
    """Return the angles (rad) wrapped to -pi…pi."""
    out: Array = (angle + np.pi) % (2 * np.pi) - np.pi
    return out


def rms(values: Array) -> float:
    """Return the rms of the finite values, NaN when there is none."""
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if len(finite) else float("nan")


def airborne(log: RunLog) -> list[tuple[float, float]]:
    """Return the intervals of flight (s); empty when the log does not show them."""
    status = log.topics.get("status")
    if status is None or "airborne" not in status:
        return []
    on = status.values("airborne") > 0.5
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(np.int8)))
    ends = np.append(status.time, log.duration)
    return [(float(ends[a]), float(ends[b])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _odometry(log: RunLog, topic: str, name: str, time: Array | None = None) -> Track | None:
    """Return the track of a topic at `time`, else as it was logged."""
    series = log.topics.get(topic)
    if series is None or ODOMETRY[0] not in series:
        return None
    rows: Array = series.take(ODOMETRY)
    if time is not None:
        make_continuous(rows[:, 3:7])
        rows = between(time, series.time, rows, LARGEST_GAP)[0]
    velocity_w = rotated_rows(rows[:, 3:7], rows[:, 7:])
    at = series.time if time is None else time
    return Track(name, at, rows[:, :3], rows[:, 3:7], velocity_w)
