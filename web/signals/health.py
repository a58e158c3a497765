"""Actuators, estimator, flight loop, link and battery, in the units people think in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from quadrotor.constants import MOTORS
from web.signals.signal import Source, norm, one, rms, vector, xyz


def _actuators(m: Any) -> Sequence[float]:
    return (
        m.thrust,
        *vector(m.torque),
        *(float(f) for f in m.thrusts),
        *(float(r) for r in m.motor_references),
        m.scaling,
    )


def _estimator(m: Any) -> Sequence[float]:
    return (
        m.mass,
        *vector(m.accelerometer_bias),
        *(math.degrees(b) for b in vector(m.gyroscope_bias)),
        1e3 * norm(m.position_innovation),
        math.degrees(norm(m.attitude_innovation)),
        1e3 * m.measurement_age,
        m.measurements_used,
        m.measurements_refused,
        m.measurements_ignored,
        m.nis / m.nis_freedom if m.nis_freedom else math.nan,
        1e3 * rms(*vector(m.position_variance)),
        1e3 * rms(*vector(m.velocity_variance)),
        math.degrees(rms(*vector(m.attitude_variance))),
    )


def _status(m: Any) -> Sequence[float]:
    return (m.tick_rate, 1e6 * m.lateness_p50, 1e6 * m.lateness_p99, 100.0 * m.missed_share)


def _link(m: Any) -> Sequence[float]:
    return (
        1e3 * m.age,
        1e3 * m.round_trip,
        1e3 * m.jitter,
        100.0 * m.loss,
        m.telemetry_rate,
        1e3 * m.clock_offset,
    )


HEALTH = (
    Source(
        ("actuators",),
        (
            one("thrust", "thrust", "N", "wrench", "actuators"),
            *xyz("torque", "wrench", "N m", "actuators"),
            *(one(f"thrust.{m}", m, "N", "rotor thrust", "actuators") for m in MOTORS),
            *(one(f"motor.{m}", m, "count", "motor reference", "actuators") for m in MOTORS),
            one("scaling", "scaling λ", "", "wrench", "actuators"),
        ),
        _actuators,
        covers=(
            "actuators.thrust",
            "actuators.torque",
            "actuators.thrusts",
            "actuators.motor_references",
            "actuators.scaling",
        ),
    ),
    Source(
        ("estimator",),
        (
            one("mass", "mass", "kg", "estimator", "estimator"),
            *xyz("bias.accelerometer", "accelerometer bias", "m/s²", "estimator"),
            *xyz("bias.gyroscope", "gyroscope bias", "°/s", "estimator"),
            one("innovation.position", "position", "mm", "innovation", "estimator"),
            one("innovation.attitude", "attitude", "°", "innovation", "estimator"),
            one("measurement.age", "pose age", "ms", "estimator", "estimator"),
            one("measurements.used", "measurements used", "", "estimator", "estimator"),
            one("measurements.refused", "measurements refused", "", "estimator", "estimator"),
            one("measurements.ignored", "measurements ignored", "", "estimator", "estimator"),
            one("nis", "NIS a number", "", "innovation", "estimator"),
            one("deviation.position", "position", "mm", "rms deviation", "estimator"),
            one("deviation.velocity", "velocity", "mm/s", "rms deviation", "estimator"),
            one("deviation.attitude", "attitude", "°", "rms deviation", "estimator"),
        ),
        _estimator,
        covers=(
            "estimator.mass",
            "estimator.accelerometer_bias",
            "estimator.gyroscope_bias",
            "estimator.measurement_age",
            "estimator.measurements_used",
            "estimator.measurements_refused",
            "estimator.measurements_ignored",
        ),
    ),
    Source(
        ("status",),
        (
            one("loop.rate", "rate", "Hz", "flight loop", "status"),
            one("loop.lateness_p50", "lateness p50", "µs", "flight loop", "status"),
            one("loop.lateness_p99", "lateness p99", "µs", "flight loop", "status"),
            one("loop.missed", "missed", "%", "flight loop", "status"),
        ),
        _status,
        covers=(
            "status.tick_rate",
            "status.lateness_p50",
            "status.lateness_p99",
            "status.missed_share",
        ),
    ),
    Source(
        ("link_status",),
        (
            one("link.age", "age", "ms", "link", "link_status"),
            one("link.round_trip", "round trip", "ms", "link", "link_status"),
            one("link.jitter", "jitter", "ms", "link", "link_status"),
            one("link.loss", "loss", "%", "link", "link_status"),
            one("link.rate", "telemetry", "Hz", "link", "link_status"),
            one("link.clock_offset", "clock offset", "ms", "vehicle clock", "link_status"),
        ),
        _link,
        covers=(
            "link_status.age",
            "link_status.round_trip",
            "link_status.jitter",
            "link_status.loss",
            "link_status.telemetry_rate",
            "link_status.clock_offset",
        ),
    ),
    Source(
        ("battery",),
        (one("battery.voltage", "voltage", "V", "battery", "battery"),),
        lambda m: (m.voltage,),
        covers=("battery.voltage",),
    ),
)
