"""Tracking errors from a log: `truth` against `reference`, both at the stamps of truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from console.evaluation.alignment import at_stamps
from flight_log.reader import read_log
from quadrotor.errors import LogFormatError
from vehicle_link.topics import decode_odometry, decode_pose, decode_reference

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TrackingErrors:
    """Errors truth - reference at the stamps of truth, within a window."""

    time: Array  # (N,) s
    position_w: Array  # (N, 3) m
    yaw: Array  # (N,) rad, wrapped to -pi..pi

    def metrics(self) -> dict[str, float]:
        """Return rms and largest position error (m), rms yaw error (deg), number of samples."""
        distance = np.linalg.norm(self.position_w, axis=1)
        return {
            "position_rms_m": float(np.sqrt(np.mean(distance**2))),
            "position_max_m": float(distance.max()),
            "yaw_rms_deg": float(np.degrees(np.sqrt(np.mean(self.yaw**2)))),
            "samples": float(len(distance)),
        }


def tracking_errors(log: Path, vehicle: str, start: float, end: float) -> TrackingErrors:
    """Return errors of the flight in `log` for start <= t <= end (s, vehicle clock).

    Where there is no truth, the tracker's poses count as it. Raises LogFormatError when either or
    the reference is missing there.
    """
    found: dict[str, dict[int, Array]] = {"truth": {}, "tracker_pose": {}, "reference": {}}
    for message in read_log(log, {f"/{vehicle}/{topic}" for topic in found}):
        if not start <= message.publish_ns * 1e-9 <= end:
            continue
        topic = message.topic.rsplit("/", 1)[1]
        if topic == "reference":
            stamp_ns, wanted = decode_reference(message.payload)
            yaw = float(wanted["yaw"][0])
            turn = (np.cos(yaw), np.sin(yaw))
            position_w = wanted["position_w"][0]
        else:
            if topic == "truth":
                stamp_ns, pose = decode_odometry(message.payload)
            else:
                pose = decode_pose(message.payload)
                stamp_ns = int(pose["stamp_ns"][0])
            w, x, y, z = pose["quaternion_wb"][0]
            turn = (1 - 2 * (y * y + z * z), 2 * (w * z + x * y))
            position_w = pose["position_w"][0]
        found[topic][stamp_ns] = np.array([*position_w, *turn])
    truth, reference = found["truth"] or found["tracker_pose"], found["reference"]
    stamps = np.array(sorted(truth), np.int64)
    wanted_at, known = at_stamps(stamps, reference)
    if not known.any():
        raise LogFormatError(
            f"{log.name} has {len(truth)} truth and {len(reference)} reference messages between "
            f"{start:.1f} s and {end:.1f} s, none at common times; was it flown to the end?"
        )
    true_at = np.array([truth[int(ns)] for ns in stamps[known]])
    wanted_at = wanted_at[known]
    yaw_error = np.arctan2(true_at[:, 4], true_at[:, 3]) - np.arctan2(
        wanted_at[:, 4], wanted_at[:, 3]
    )
    wrapped: Array = (yaw_error + np.pi) % (2 * np.pi) - np.pi
    times = stamps[known].astype(np.float64) * 1e-9
    return TrackingErrors(times, true_at[:, :3] - wanted_at[:, :3], wrapped)
