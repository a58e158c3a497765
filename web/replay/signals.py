"""The signals of a run: those of the live page by the same names, then every number of the log.

A signal is a column and a factor: angles are stored in rad and shown in degrees.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from quadrotor.constants import MOTORS
from web.signals import SIGNALS, Signal

DEGREES = math.degrees(1.0)
MILLI, MICRO = 1e3, 1e6
Source = tuple[str, str, float]  # topic, column, factor


def _axes(name: str, topic: str, column: str, factor: float = 1.0) -> dict[str, Source]:
    return {f"{name}.{axis}": (topic, f"{column}.{axis}", factor) for axis in "xyz"}


SOURCES: dict[str, Source] = {
    **_axes("state.position", "state", "pose.pose.position"),
    **_axes("state.velocity", "state", "@velocity"),
    **{f"state.{a}": ("state", f"@{a}", DEGREES) for a in ("roll", "pitch", "yaw")},
    **_axes("state.rate", "state", "twist.twist.angular", DEGREES),
    **_axes("reference.position", "reference", "position"),
    **_axes("reference.velocity", "reference", "velocity"),
    **_axes("reference.acceleration", "reference", "acceleration"),
    "reference.yaw": ("reference", "yaw", DEGREES),
    **_axes("error.position", "state", "@error"),
    "error.distance": ("state", "@error.distance", 1.0),
    "error.yaw": ("state", "@error.yaw", DEGREES),
    "thrust": ("actuators", "thrust", 1.0),
    **_axes("torque", "actuators", "torque"),
    **{f"thrust.{m}": ("actuators", f"thrusts[{k}]", 1.0) for k, m in enumerate(MOTORS)},
    **{f"motor.{m}": ("actuators", f"motor_references[{k}]", 1.0) for k, m in enumerate(MOTORS)},
    "scaling": ("actuators", "scaling", 1.0),
    "mass": ("estimator", "mass", 1.0),
    **_axes("bias.accelerometer", "estimator", "accelerometer_bias"),
    **_axes("bias.gyroscope", "estimator", "gyroscope_bias", DEGREES),
    "measurement.age": ("estimator", "measurement_age", MILLI),
    "measurements.used": ("estimator", "measurements_used", 1.0),
    "measurements.refused": ("estimator", "measurements_refused", 1.0),
    "measurements.ignored": ("estimator", "measurements_ignored", 1.0),
    **_axes("truth.position", "truth", "pose.pose.position"),
    "truth.position_error": ("truth", "@position_error", MILLI),
    "truth.velocity_error": ("truth", "@velocity_error", 1.0),
    **_axes("bearing_pose.position", "bearing_pose", "pose.pose.position"),
    "comparison.position_bound": ("comparison", "position_bound", MILLI),
    "comparison.attitude_bound": ("comparison", "attitude_bound", DEGREES),
    "loop.rate": ("status", "tick_rate", 1.0),
    "loop.lateness_p50": ("status", "lateness_p50", MICRO),
    "loop.lateness_p99": ("status", "lateness_p99", MICRO),
    "loop.missed": ("status", "missed_share", 100.0),
    "link.age": ("link_status", "age", MILLI),
    "link.round_trip": ("link_status", "round_trip", MILLI),
    "link.loss": ("link_status", "loss", 100.0),
    "link.jitter": ("link_status", "jitter", MILLI),
    "link.rate": ("link_status", "telemetry_rate", 1.0),
    "battery.voltage": ("battery", "voltage", 1.0),
}
"""Live signals as columns of a log. Those that need more than a factor are not among them."""

_COMPARED = {"position_error": MILLI, "attitude_error": DEGREES}


@dataclass(frozen=True, slots=True)
class Recorded:
    """A signal of a run; `known` ones have words and a unit, the others their path."""

    name: str
    label: str
    unit: str
    group: str
    topic: str
    column: str
    factor: float = 1.0
    known: bool = True


def signals_of(
    columns: Mapping[str, Collection[str]], names: Mapping[str, str]
) -> Iterator[Recorded]:
    """Yield the signals of a log.

    Args:
        columns: topic without the vehicle's namespace → its columns.
        names: texts of the topic `comparison` that say which estimator is which, by path.
    """
    live = {signal.name: signal for signal in SIGNALS}
    sources = SOURCES | _compared(names)
    for name, signal in live.items():
        topic, column, factor = sources.get(name, ("", "", 1.0))
        if column in columns.get(topic, ()):
            yield _recorded(signal, topic, column, factor)
    for topic, paths in columns.items():
        for path in paths:
            if not path.startswith("@"):
                yield Recorded(f"{topic}/{path}", path, "", topic, topic, path, known=False)


def _compared(names: Mapping[str, str]) -> dict[str, Source]:
    """Return `comparison.vehicle.position_error` is `estimators[0].position_error`, and so on."""
    return {
        f"comparison.{estimator}.{figure}": (
            "comparison",
            f"{path.removesuffix('.name')}.{figure}",
            factor,
        )
        for path, estimator in names.items()
        for figure, factor in _COMPARED.items()
    }


def _recorded(signal: Signal, topic: str, column: str, factor: float) -> Recorded:
    return Recorded(signal.name, signal.label, signal.unit, signal.group, topic, column, factor)


def as_json(signal: Recorded, constant: float | None) -> dict[str, Any]:
    """Return the signal for the page; `constant`: the only value it has."""
    fields: dict[str, Any] = {
        "name": signal.name,
        "label": signal.label,
        "unit": signal.unit,
        "group": signal.group,
        "known": signal.known,
    }
    if constant is not None:
        fields["constant"] = None if math.isnan(constant) else constant * signal.factor
    return fields
