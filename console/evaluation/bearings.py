"""A flight on bearings from its log: its times, and its errors relative to truth and reference."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import numpy.typing as npt

from bearing_sim.beacons import parse_layout
from console.evaluation.alignment import between, rotated_rows
from console.evaluation.bearings_bound import Frame, PoseBound, posterior_bound
from console.evaluation.figures import rms
from console.evaluation.flight_checks import SEVERE
from console.evaluation.log_columns import read_parameters
from estimation.error_state_parameters import ErrorStateParameters
from flight_log.attached import logged_value
from flight_log.columns.log_columns import read_topics
from flight_log.columns.topic import Topic
from flight_log.fields import ODOMETRY, REFERENCE, TRACKED, TRACKED_ATTITUDE
from quadrotor.errors import LinkError, LogFormatError, MeasurementError
from quadrotor.parameter_description import ParameterValue
from quadrotor.plain_rotations import make_continuous, rotation_vectors_between
from quadrotor.records import Array, Stamps, beacon_ids_of
from vehicle_link.messages import decode
from vehicle_link.messages.records import Log, ParameterChange
from vehicle_link.topics.measurements import decode_bearings

Floats = npt.NDArray[np.float32]

WANTED: dict[str, tuple[str, ...]] = {
    "truth": ODOMETRY,
    "state": ODOMETRY,
    "tracker_pose": TRACKED + TRACKED_ATTITUDE,
    "reference": REFERENCE,
    "actuators": ("scaling",),
    "status": ("mode",),
}
WHOLE = ("events", "parameter_changes", "bearings")


@dataclass(frozen=True, slots=True)
class BearingsFlight:
    """Truth, estimate and reference at the stamps of truth while bearings were flown on.

    Without truth, on a real vehicle, the tracker's poses count as truth; they have no velocity.

    Attributes:
        time: (N,) s.
        truth, estimate: (N, 10) position, velocity (NaN when unknown), quaternion.
        reference_w: (N, 3) m.
        saturated: share of ticks with a scaled wrench.
        window: start and end, s, of what is judged.
        fell_back: the events that report a fall-back.
        emergencies: number of emergency landings and cuts of the motors from the hand-over on.
        bound: least error to the truth, or to the tracker's poses with their noise, that an
            estimate from these frames could have in the window; NaN when the log lacks it.
    """

    time: Array
    truth: Array
    estimate: Array
    reference_w: Array
    saturated: float
    window: tuple[float, float]
    fell_back: tuple[str, ...]
    emergencies: int
    bound: PoseBound

    @property
    def judged(self) -> npt.NDArray[np.bool_]:
        """Return which rows (N,) lie in the window."""
        start, end = self.window
        return (self.time >= start) & (self.time <= end)

    @property
    def turns(self) -> Array:
        """Return the rotation vectors (N, 3), rad, world axes, from estimated to true attitude."""
        return rotation_vectors_between(self.estimate[:, 6:], self.truth[:, 6:])

    def metrics(self) -> dict[str, float]:
        """Return tracking and estimation errors in the window: m, m/s, deg, shares."""
        rows = self.judged
        truth, estimate = self.truth[rows], self.estimate[rows]
        tracking = np.linalg.norm(truth[:, :3] - self.reference_w[rows], axis=1)
        off = truth - estimate
        start, end = self.window
        metrics = {
            "position_rms_m": rms(tracking),
            "position_max_m": float(tracking.max()),
            "estimate_position_rms_m": rms(np.linalg.norm(off[:, :3], axis=1)),
            "estimate_velocity_rms_m_s": rms(np.linalg.norm(off[:, 3:6], axis=1)),
            "estimate_attitude_rms_deg": float(
                np.degrees(rms(np.linalg.norm(self.turns[rows], axis=1)))
            ),
            "saturated_share": self.saturated,
            "fallbacks": float(len(self.fell_back)),
            "emergencies": float(self.emergencies),
            "judged_s": end - start,
            "samples": float(rows.sum()),
        }
        return {name: value for name, value in metrics.items() if not np.isnan(value)}


def read_flight(log: Path, vehicle: str, ramp: float = 0.0) -> BearingsFlight:
    """Return the first period on bearings of a log.

    Args:
        ramp: s left out at both ends of a trajectory, and at the start of anything else.

    Raises LogFormatError when bearings were not flown on, or truth is missing.
    """
    topics = read_topics(log, vehicle, (*WANTED, *WHOLE))
    phase = _phase(topics["parameter_changes"])
    if not phase:
        raise LogFormatError(
            f"{log.name} never flew on bearings: no change of estimation.source to bearings in it"
        )
    newest = max(int(one.publish_ns.max()) for one in topics.values() if len(one))
    begin_ns, end_ns = phase[0], newest if len(phase) == 1 else phase[1]
    begin, end = begin_ns * 1e-9, end_ns * 1e-9
    events = [
        (ns * 1e-9, str(cast("Log", decode(payload, topics["events"].decodable_name)).msg))
        for ns, payload in _payloads(topics["events"])
    ]
    window = _window([e for e in events if begin <= e[0] <= end], begin, end, ramp)
    stamps, truth = _rows(topics, "truth", begin_ns, end_ns)
    tracked = not len(stamps)
    if tracked:
        stamps, truth = _rows(topics, "tracker_pose", begin_ns, end_ns)
    state_ns, state = _rows(topics, "state", begin_ns, end_ns)
    make_continuous(state[:, 3:7])
    estimate, known = between(stamps, state_ns, state)
    del state
    wanted_w, known_too = between(stamps, *_rows(topics, "reference", begin_ns, end_ns))
    rows = known & known_too
    time = stamps[rows].astype(np.float64) * 1e-9
    if not ((time >= window[0]) & (time <= window[1])).any():
        raise LogFormatError(
            f"{log.name} has no truth, state and reference at common times between "
            f"{window[0]:.1f} s and {window[1]:.1f} s: too short a stay on bearings"
        )
    frames = _frames(topics["bearings"], begin, end)
    values = _values(log, topics["parameter_changes"], window[0])
    bound = _bound(frames, stamps, truth, values, window, tracked=tracked)
    _, scaling = _rows(topics, "actuators", round(window[0] * 1e9), round(window[1] * 1e9))
    return BearingsFlight(
        time,
        _state(np.asarray(truth[rows], np.float64)),
        estimate=_state(estimate[rows]),
        reference_w=wanted_w[rows],
        saturated=float((scaling < 1.0).mean()) if len(scaling) else 0.0,
        window=window,
        fell_back=tuple(text for _, text in events if _is_fall_back(text)),
        emergencies=_emergencies(topics["status"], begin_ns),
        bound=bound,
    )


def _is_fall_back(text: str) -> bool:
    return text.startswith("fell back") or "no tracker to fall back" in text


def _bound(
    frames: list[Frame],
    stamps: Stamps,
    truth: Floats,
    values: Mapping[str, ParameterValue],
    window: tuple[float, float],
    *,
    tracked: bool,
) -> PoseBound:
    """Return the bound of an estimate's error; `tracked`: the truth is the tracker's poses."""
    noise = _noise(values)
    nearest = np.searchsorted(stamps[:-1], [round(1e9 * frame.time) for frame in frames])
    poses = truth[nearest].astype(np.float64)
    bound = posterior_bound(frames, poses[:, :3], poses[:, 3:7], _places(values), noise, window)
    if not tracked:
        return bound
    return bound.seen_by(noise.pose_position_sigma, math.radians(noise.pose_attitude_sigma))


def _payloads(topic: Topic) -> list[tuple[int, bytes]]:
    return list(zip(topic.publish_ns.tolist(), topic.payloads, strict=False))


def _phase(changes: Topic) -> list[int]:
    """Return the start, and the end, of the first flight on bearings (ns), as far as
    they happened.
    """
    phase: list[int] = []
    for ns, payload in _payloads(changes):
        change = cast("ParameterChange", decode(payload, changes.decodable_name))
        if change.name == "estimation.source":
            on = logged_value(change.new_value) == "bearings"
            if on is (len(phase) == 0) and len(phase) < 2:
                phase.append(ns)
    return phase


def _emergencies(status: Topic, begin_ns: int) -> int:
    stamps = status.publish_ns
    return sum(
        bool(stamps[index] >= begin_ns) and mode in SEVERE
        for index, mode in status.texts.get("mode", [])
    )


def _rows(
    topics: dict[str, Topic], topic: str, begin_ns: int, end_ns: int
) -> tuple[Stamps, Floats]:
    """Return stamps (N,), rising, and the numbers of WANTED, (N, K). Removes the topic from
    `topics`.
    """
    found = topics.pop(topic)
    stamps, rows = found.publish_ns, found.take(WANTED[topic])
    del found
    if not (np.diff(stamps) >= 0).all():
        order = np.argsort(stamps, kind="stable")
        stamps, rows = stamps[order], rows[order]
    begin, end = np.searchsorted(stamps, [begin_ns, end_ns + 1])
    return stamps[begin:end], rows[begin:end]


def _state(odometry: npt.NDArray[np.floating]) -> Array:
    """Return position, velocity (world, NaN if missing) and quaternion, (N, 10), of odometry."""
    position_w, quaternion, velocity_b = odometry[:, :3], odometry[:, 3:7], odometry[:, 7:]
    if velocity_b.shape[1]:
        velocity_w = rotated_rows(quaternion, velocity_b)
    else:
        velocity_w = np.full_like(position_w, np.nan)
    out: Array = np.concatenate([position_w, velocity_w, quaternion], axis=1)
    return out


def _window(
    events: list[tuple[float, str]], begin: float, end: float, ramp: float
) -> tuple[float, float]:
    """Return start and end of what is judged: the manoeuvre without its ramps, if it is
    that long.
    """
    start, late = begin + ramp, 0.0
    for time, text in events:
        if text.replace("_", " ").startswith("follow trajectory by"):  # with _ in older logs
            start, late = time + ramp, ramp
        elif text.startswith("velocity by"):
            start = time
        else:
            continue
        break
    return (start, end - late) if start < end - late else (begin, end)


def _frames(topic: Topic, begin: float, end: float) -> list[Frame]:
    """Return the usable frames of bearings between two times (s), in order."""
    frames = {}
    for ns, payload in _payloads(topic):
        if begin <= ns * 1e-9 <= end:
            with suppress(LinkError, MeasurementError):
                seen = decode_bearings(payload)
                frames[ns] = Frame(ns * 1e-9, tuple(beacon_ids_of(seen)), float(seen["sigma"][0]))
    return [frames[ns] for ns in sorted(frames)]


def _values(log: Path, changes: Topic, until: float) -> dict[str, ParameterValue]:
    """Return the vehicle's parameters at a time (s), as far as they are in the log."""
    try:
        values = dict(read_parameters(log).vehicle)
    except LogFormatError:
        values = {}
    for ns, payload in _payloads(changes):
        if ns * 1e-9 <= until:
            change = cast("ParameterChange", decode(payload, changes.decodable_name))
            with suppress(LogFormatError):
                values[change.name] = logged_value(change.new_value)
    return values


def _places(values: Mapping[str, ParameterValue]) -> dict[int, list[float]]:
    """Return the vehicle's beacon positions (m, by id); empty when unknown."""
    try:
        beacons = parse_layout(str(values["beacons.layout"]))
    except (KeyError, MeasurementError):
        return {}
    return dict(zip(beacons.ids.tolist(), beacons.positions_w.tolist(), strict=True))


def _noise(values: Mapping[str, ParameterValue]) -> ErrorStateParameters:
    """Return the IMU noise that the vehicle assumes, with defaults for values not in the log."""
    noise = ErrorStateParameters()
    for name, default in ErrorStateParameters():
        value = values.get(f"estimation.error_state.{name}", default)
        setattr(noise, name, value if isinstance(value, int | float) and value > 0.0 else default)
    return noise
