"""A flight on bearings as its log tells it: when, how near to truth and reference."""

from __future__ import annotations

import ast
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from bearing_sim.emulator import BearingParameters
from console.experiments.alignment import at_stamps
from quadrotor.errors import LogFormatError
from vehicle_link.log.reader import read_attachments, read_log
from vehicle_link.messages import decode
from vehicle_link.topics import decode_actuators, decode_odometry, decode_pose, decode_reference

Array = npt.NDArray[np.float64]

EMERGENCIES = ("emergency_land", "cut")


@dataclass(frozen=True, slots=True)
class BearingsFlight:
    """Truth, estimate and reference at the stamps of truth while bearings were flown on.

    Without truth, on a real vehicle, the tracker's poses count as it; they have no velocity.

    Attributes:
        time: (N,) s. truth, estimate: (N, 10) position, velocity (NaN when unknown), quaternion.
        reference_w: (N, 3) m. saturated: share of ticks with a scaled wrench.
        window: s, what is judged. fell_back: the events that say so.
        emergencies: times the vehicle landed in an emergency or its motors were cut, from the
            hand-over on.
    """

    time: Array
    truth: Array
    estimate: Array
    reference_w: Array
    saturated: float
    window: tuple[float, float]
    fell_back: tuple[str, ...]
    emergencies: int

    @property
    def judged(self) -> npt.NDArray[np.bool_]:
        """(N,) which rows lie in the window."""
        start, end = self.window
        return (self.time >= start) & (self.time <= end)

    @property
    def turns(self) -> Array:
        """(N, 3) rad, world axes: rotation vector from the estimated attitude to the true one."""
        w, x, y, z = self.truth[:, 6:].T
        a, b, c, d = self.estimate[:, 6:].T
        scalar = w * a + x * b + y * c + z * d
        vector = np.stack(
            [
                -w * b + x * a - y * d + z * c,
                -w * c + x * d + y * a - z * b,
                -w * d - x * c + y * b + z * a,
            ],
            axis=1,
        )
        length = np.linalg.norm(vector, axis=1)
        angle = 2.0 * np.arctan2(length, np.abs(scalar))
        sign = np.where(scalar < 0.0, -1.0, 1.0)
        turns: Array = vector * (sign * angle / np.maximum(length, 1e-12))[:, None]
        return turns

    def metrics(self) -> dict[str, float]:
        """Tracking and estimation errors in the window: m, m/s, deg, shares."""
        rows = self.judged
        truth, estimate = self.truth[rows], self.estimate[rows]
        tracking = np.linalg.norm(truth[:, :3] - self.reference_w[rows], axis=1)
        off = truth - estimate
        start, end = self.window
        metrics = {
            "position_rms_m": _rms(tracking),
            "position_max_m": float(tracking.max()),
            "estimate_position_rms_m": _rms(np.linalg.norm(off[:, :3], axis=1)),
            "estimate_velocity_rms_m_s": _rms(np.linalg.norm(off[:, 3:6], axis=1)),
            "estimate_attitude_rms_deg": float(
                np.degrees(_rms(np.linalg.norm(self.turns[rows], axis=1)))
            ),
            "saturated_share": self.saturated,
            "fallbacks": float(len(self.fell_back)),
            "emergencies": float(self.emergencies),
            "judged_s": end - start,
            "samples": float(rows.sum()),
        }
        return {name: value for name, value in metrics.items() if not np.isnan(value)}


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def read_flight(log: Path, vehicle: str, ramp: float = 0.0) -> BearingsFlight:
    """The first stay on bearings of a log.

    Args:
        ramp: s left out at both ends of a trajectory, and at the start of anything else.

    Raises LogFormatError when it was not flown on bearings, or truth is missing.
    """
    found: dict[str, dict[int, Array]] = {
        "truth": {}, "tracker_pose": {}, "state": {}, "reference": {},
    }  # fmt: skip
    topics = (*found, "actuators", "events", "parameter_changes", "status")
    scaled: list[tuple[int, bool]] = []
    events: list[tuple[float, str]] = []
    phase: list[float] = []
    newest, mode, emergencies = 0.0, "", 0
    for message in read_log(log, {f"/{vehicle}/{topic}" for topic in topics}):
        stamp_ns, topic = message.publish_ns, message.topic.rsplit("/", 1)[1]
        newest = max(newest, stamp_ns * 1e-9)
        if topic == "parameter_changes":
            change = decode(message.payload, message.type_name)
            if change.name == "estimation.source":
                on = ast.literal_eval(change.new_value) == "bearings"
                if on is (len(phase) == 0) and len(phase) < 2:
                    phase.append(stamp_ns * 1e-9)
        elif topic == "events":
            events.append((stamp_ns * 1e-9, decode(message.payload, message.type_name).msg))
        elif topic == "status":
            was, mode = mode, str(decode(message.payload, message.type_name).mode)
            emergencies += bool(phase) and mode != was and mode in EMERGENCIES
        elif not phase or len(phase) == 2:
            continue
        elif topic == "reference":
            wanted = decode_reference(message.payload)[1]
            found[topic][stamp_ns] = wanted["position_w"][0].copy()
        elif topic == "actuators":
            scaled.append((stamp_ns, bool(decode_actuators(message.payload)[1]["scaling"][0] < 1)))
        elif topic == "tracker_pose":
            pose = decode_pose(message.payload)
            found[topic][stamp_ns] = np.concatenate(
                [pose["position_w"][0], (np.nan,) * 3, pose["quaternion_wb"][0]]
            )
        else:
            row = decode_odometry(message.payload, vehicle)[1]
            found[topic][stamp_ns] = np.concatenate(
                [row[name][0] for name in ("position_w", "velocity_w", "quaternion_wb")]
            )
    if not phase:
        raise LogFormatError(
            f"{log.name} never flew on bearings: no change of estimation.source to bearings in it"
        )
    begin, end = phase[0], newest if len(phase) == 1 else phase[1]
    window = _window([e for e in events if begin <= e[0] <= end], begin, end, ramp)
    truth = found["truth"] or found["tracker_pose"]
    stamps = np.array(sorted(truth), np.int64)
    estimate, known = at_stamps(stamps, _unflipped(found["state"]))
    wanted_w, known_too = at_stamps(stamps, found["reference"])
    rows = known & known_too
    time = stamps[rows] * 1e-9
    if not ((time >= window[0]) & (time <= window[1])).any():
        raise LogFormatError(
            f"{log.name} has no truth, state and reference at common times between "
            f"{window[0]:.1f} s and {window[1]:.1f} s: too short a stay on bearings"
        )
    inside = [flag for ns, flag in scaled if window[0] <= ns * 1e-9 <= window[1]]
    return BearingsFlight(
        time,
        np.array([truth[int(ns)] for ns in stamps[rows]]),
        estimate[rows],
        wanted_w[rows],
        sum(inside) / max(len(inside), 1),
        window,
        tuple(
            text for _, text in events
            if text.startswith("fell back") or "no tracker to fall back" in text
        ),
        emergencies,
    )  # fmt: skip


def _unflipped(state: dict[int, Array]) -> dict[int, Array]:
    """The same attitudes with quaternions of one sign, to interpolate between."""
    out: dict[int, Array] = {}
    last = np.zeros(4)
    for ns in sorted(state):
        row = state[ns]
        if row[6:] @ last < 0.0:
            row = np.concatenate([row[:6], -row[6:]])
        out[ns], last = row, row[6:]
    return out


def _window(
    events: list[tuple[float, str]], begin: float, end: float, ramp: float
) -> tuple[float, float]:
    """What of the stay on bearings is judged: the manoeuvre without its ramps, if that long."""
    start, late = begin + ramp, 0.0
    for time, text in events:
        if text.startswith("follow_trajectory by"):
            start, late = time + ramp, ramp
        elif text.startswith("velocity by"):
            start = time
        else:
            continue
        break
    return (start, end - late) if start < end - late else (begin, end)


def papers_sensor(log: Path) -> bool:
    """Whether the emulated sensor was that of Sec. 7, which the limits are for.

    A station's run has its own parameters beside the vehicle's, and may have changed them.
    """
    values = json.loads(read_attachments(log).get("parameters.json", b"{}"))
    prefix, changed = "bearings.", False
    if "station" in values:
        values, prefix = dict(values["station"]), "station.bearings."
        for message in read_log(log):
            if message.topic.endswith("/parameter_changes"):
                name = decode(message.payload, message.type_name).name
                changed |= name.startswith(prefix) and name != f"{prefix}seed"
    return not changed and all(
        values.get(f"{prefix}{name}", default) == default
        for name, default in BearingParameters()
        if name != "seed"
    )
