"""Numbers a chart or the state table can show: name, label, unit, and where it comes from.

Each source turns one topic's newest message into the values of its signals, in order. A value
is NaN when its topic is stale or absent: the charts draw a gap, the table greys the cell.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from web.angles import roll_pitch_yaw, rotate
from web.live import STALE, Live


@dataclass(frozen=True, slots=True)
class Signal:
    name: str  # `state.position.x`
    label: str  # `x`
    unit: str
    group: str  # `position`
    topic: str  # whose age it has


@dataclass(frozen=True, slots=True)
class _Source:
    topics: tuple[str, ...]  # all must be current; the first one's age is shown
    signals: tuple[Signal, ...]
    values: Callable[..., Sequence[float]]


def _xyz(prefix: str, group: str, unit: str, topic: str) -> list[Signal]:
    return [Signal(f"{prefix}.{axis}", axis, unit, group, topic) for axis in "xyz"]


def _vector(v: Any) -> tuple[float, float, float]:
    return (v.x, v.y, v.z)


def _norm(v: Any) -> float:
    return math.sqrt(v.x * v.x + v.y * v.y + v.z * v.z)


def _state(m: Any) -> Sequence[float]:
    pose, twist = m.pose.pose, m.twist.twist
    angles = roll_pitch_yaw(pose.orientation)
    return (
        *_vector(pose.position),
        *rotate(pose.orientation, twist.linear),  # body axes to world axes
        *(math.degrees(a) for a in angles),
        *(math.degrees(a) for a in _vector(twist.angular)),
    )


def _reference(m: Any) -> Sequence[float]:
    return (
        *_vector(m.position),
        *_vector(m.velocity),
        *_vector(m.acceleration),
        math.degrees(m.yaw),
    )


def _tracking(state: Any, reference: Any) -> Sequence[float]:
    p, r = state.pose.pose.position, reference.position
    error = (p.x - r.x, p.y - r.y, p.z - r.z)
    yaw = roll_pitch_yaw(state.pose.pose.orientation)[2] - reference.yaw
    return (*error, math.hypot(*error), math.degrees(math.remainder(yaw, math.tau)))


def _actuators(m: Any) -> Sequence[float]:
    return (
        m.thrust,
        *_vector(m.torque),
        *(float(f) for f in m.thrusts),
        *(float(r) for r in m.motor_references),
        m.scaling,
    )


def _estimator(m: Any) -> Sequence[float]:
    return (
        m.mass,
        *_vector(m.accelerometer_bias),
        *(math.degrees(b) for b in _vector(m.gyroscope_bias)),
        1e3 * _norm(m.position_innovation),
        math.degrees(_norm(m.attitude_innovation)),
        1e3 * m.measurement_age,
    )


def _truth(state: Any, truth: Any) -> Sequence[float]:
    p, t = state.pose.pose.position, truth.pose.pose.position
    v = rotate(state.pose.pose.orientation, state.twist.twist.linear)
    u = rotate(truth.pose.pose.orientation, truth.twist.twist.linear)
    return (
        *_vector(t),
        1e3 * math.dist((p.x, p.y, p.z), (t.x, t.y, t.z)),
        math.dist(v, u),
    )


def _status(m: Any) -> Sequence[float]:
    return (m.tick_rate, 1e6 * m.lateness_p50, 1e6 * m.lateness_p99, 100.0 * m.missed_share)


def _link(m: Any) -> Sequence[float]:
    return (1e3 * m.age, 1e3 * m.round_trip, 100.0 * m.loss, m.telemetry_rate)


def _bearing_pose(m: Any) -> Sequence[float]:
    covariance = m.pose.covariance  # 6 by 6, position first
    return (
        *_vector(m.pose.pose.position),
        1e3 * _rms(covariance[0], covariance[7], covariance[14]),
    )


def _comparison(m: Any) -> Sequence[float]:
    errors, angles, deviations = ([math.nan] * len(COMPARED) for _ in range(3))
    for one in m.estimators:
        if one.name not in COMPARED:
            continue
        i, covariance = COMPARED.index(one.name), one.position_covariance
        errors[i] = 1e3 * one.position_error
        angles[i] = math.degrees(one.attitude_error)
        deviations[i] = 1e3 * _rms(covariance[0], covariance[4], covariance[8])
    bounds = (1e3 * m.position_bound, math.degrees(m.attitude_bound))
    return (*errors, bounds[0], *angles, bounds[1], *deviations)


def _rms(*variances: float) -> float:
    """The length that an error of these variances has in the mean square."""
    total = float(sum(variances))
    return math.sqrt(total) if total >= 0.0 else math.nan


def _one(name: str, label: str, unit: str, group: str, topic: str) -> Signal:
    return Signal(name, label, unit, group, topic)


_MOTORS = ("front", "left", "rear", "right")

COMPARED = (
    "vehicle",
    "error_state",
    "complementary",
    "complementary:paper",
    "complementary:bearings",
    "complementary:resolved",
)
"""Results of the topic `comparison` that have signals: the vehicle's own estimate, and every
estimator and preset of gains that comes along. One that was registered has its row in the Beacons
tab and no signal."""


def _compared(name: str, group: str, unit: str) -> list[Signal]:
    return [Signal(f"comparison.{name}.{of}", of, unit, group, "comparison") for of in COMPARED]


_SOURCES = (
    _Source(
        ("state",),
        (
            *_xyz("state.position", "position", "m", "state"),
            *_xyz("state.velocity", "velocity", "m/s", "state"),
            *(_one(f"state.{a}", a, "°", "attitude", "state") for a in ("roll", "pitch", "yaw")),
            *_xyz("state.rate", "body rate", "°/s", "state"),
        ),
        _state,
    ),
    _Source(
        ("reference",),
        (
            *_xyz("reference.position", "reference position", "m", "reference"),
            *_xyz("reference.velocity", "reference velocity", "m/s", "reference"),
            *_xyz("reference.acceleration", "reference acceleration", "m/s²", "reference"),
            _one("reference.yaw", "yaw", "°", "reference position", "reference"),
        ),
        _reference,
    ),
    _Source(
        ("state", "reference"),
        (
            *_xyz("error.position", "tracking error", "m", "state"),
            _one("error.distance", "distance", "m", "tracking error", "state"),
            _one("error.yaw", "yaw", "°", "tracking error", "state"),
        ),
        _tracking,
    ),
    _Source(
        ("actuators",),
        (
            _one("thrust", "thrust", "N", "wrench", "actuators"),
            *_xyz("torque", "wrench", "N m", "actuators"),
            *(_one(f"thrust.{m}", m, "N", "rotor thrust", "actuators") for m in _MOTORS),
            *(_one(f"motor.{m}", m, "count", "motor reference", "actuators") for m in _MOTORS),
            _one("scaling", "scaling λ", "", "wrench", "actuators"),
        ),
        _actuators,
    ),
    _Source(
        ("estimator",),
        (
            _one("mass", "mass", "kg", "estimator", "estimator"),
            *_xyz("bias.accelerometer", "accelerometer bias", "m/s²", "estimator"),
            *_xyz("bias.gyroscope", "gyroscope bias", "°/s", "estimator"),
            _one("innovation.position", "position", "mm", "innovation", "estimator"),
            _one("innovation.attitude", "attitude", "°", "innovation", "estimator"),
            _one("measurement.age", "pose age", "ms", "estimator", "estimator"),
        ),
        _estimator,
    ),
    _Source(
        ("state", "truth"),
        (
            *_xyz("truth.position", "truth position", "m", "truth"),
            _one("truth.position_error", "position", "mm", "estimate against truth", "truth"),
            _one("truth.velocity_error", "velocity", "m/s", "estimate against truth", "truth"),
        ),
        _truth,
    ),
    _Source(
        ("bearing_pose",),
        (
            *_xyz("bearing_pose.position", "one-frame position", "m", "bearing_pose"),
            _one("bearing_pose.deviation", "rms", "mm", "one-frame deviation", "bearing_pose"),
        ),
        _bearing_pose,
    ),
    _Source(
        ("comparison",),
        (
            *_compared("position_error", "position error to truth", "mm"),
            _one(
                "comparison.position_bound",
                "one-frame bound",
                "mm",
                "position error to truth",
                "comparison",
            ),
            *_compared("attitude_error", "attitude error to truth", "°"),
            _one(
                "comparison.attitude_bound",
                "one-frame bound",
                "°",
                "attitude error to truth",
                "comparison",
            ),
            *_compared("deviation", "rms deviation an estimator states", "mm"),
        ),
        _comparison,
    ),
    _Source(
        ("status",),
        (
            _one("loop.rate", "rate", "Hz", "flight loop", "status"),
            _one("loop.lateness_p50", "lateness p50", "µs", "flight loop", "status"),
            _one("loop.lateness_p99", "lateness p99", "µs", "flight loop", "status"),
            _one("loop.missed", "missed", "%", "flight loop", "status"),
        ),
        _status,
    ),
    _Source(
        ("link_status",),
        (
            _one("link.age", "age", "ms", "link", "link_status"),
            _one("link.round_trip", "round trip", "ms", "link", "link_status"),
            _one("link.loss", "loss", "%", "link", "link_status"),
            _one("link.rate", "telemetry", "Hz", "link", "link_status"),
        ),
        _link,
    ),
    _Source(
        ("battery",),
        (_one("battery.voltage", "voltage", "V", "battery", "battery"),),
        lambda m: (m.voltage,),
    ),
)

SIGNALS: tuple[Signal, ...] = tuple(s for source in _SOURCES for s in source.signals)
INDEX: dict[str, int] = {signal.name: i for i, signal in enumerate(SIGNALS)}


def snapshot(live: Live) -> list[float]:
    """The value of every signal now, in the order of SIGNALS; NaN where stale."""
    values: list[float] = []
    for source in _SOURCES:
        messages = [live.current(topic) for topic in source.topics]
        if any(message is None for message in messages):
            values.extend([math.nan] * len(source.signals))
        else:
            values.extend(source.values(*messages))
    return values


def describe() -> dict[str, Any]:
    """What the page needs to list and label the signals."""
    return {
        "signals": [asdict(signal) for signal in SIGNALS],
        "topics": list(STALE),
        "stale": STALE,
    }
