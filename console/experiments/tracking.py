"""Tracking errors from a log: `truth` against `reference`, matched by stamp."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from quadrotor.errors import LogFormatError
from vehicle_link.log.reader import read_log
from vehicle_link.topics import decode_odometry, decode_reference

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TrackingErrors:
    """Errors truth - reference at the stamps of truth, within a window."""

    time: Array  # (N,) s
    position_w: Array  # (N, 3) m
    yaw: Array  # (N,) rad, wrapped to -pi..pi

    def metrics(self) -> dict[str, float]:
        """rms and largest position error (m), rms yaw error (deg), number of samples."""
        distance = np.linalg.norm(self.position_w, axis=1)
        return {
            "position_rms_m": float(np.sqrt(np.mean(distance**2))),
            "position_max_m": float(distance.max()),
            "yaw_rms_deg": float(np.degrees(np.sqrt(np.mean(self.yaw**2)))),
            "samples": float(len(distance)),
        }


def tracking_errors(log: Path, vehicle: str, start: float, end: float) -> TrackingErrors:
    """Errors of the flight in `log` for start <= t <= end (s, vehicle clock).

    Raises LogFormatError when truth or reference is missing there.
    """
    truth: dict[int, tuple[Array, float]] = {}
    reference: dict[int, tuple[Array, float]] = {}
    topics = {f"/{vehicle}/truth", f"/{vehicle}/reference"}
    for message in read_log(log, topics):
        if not start <= message.publish_ns * 1e-9 <= end:
            continue
        if message.topic.endswith("truth"):
            stamp_ns, state = decode_odometry(message.payload)
            w, x, y, z = state["quaternion_wb"][0]
            yaw = float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
            truth[stamp_ns] = (state["position_w"][0].copy(), yaw)
        else:
            stamp_ns, wanted = decode_reference(message.payload)
            reference[stamp_ns] = (wanted["position_w"][0].copy(), float(wanted["yaw"][0]))
    common = sorted(truth.keys() & reference.keys())
    if not common:
        raise LogFormatError(
            f"{log.name} has {len(truth)} truth and {len(reference)} reference messages between "
            f"{start:.1f} s and {end:.1f} s, none at common stamps; was it flown to the end?"
        )
    position = np.array([truth[s][0] - reference[s][0] for s in common])
    yaw_error = np.array([truth[s][1] - reference[s][1] for s in common])
    wrapped = (yaw_error + np.pi) % (2 * np.pi) - np.pi
    return TrackingErrors(np.array(common) * 1e-9, position, wrapped)
