"""Signals of actuators, estimator, flight loop, link and battery, in units easy to read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from quadrotor.constants import MOTORS
from web.signals.motion import DEGREES
from web.signals.signal import Array, Signal, Source, one, rms, scaled, xyz

MILLI, MICRO = 1e3, 1e6


def _axes(*names: str) -> tuple[str, ...]:
    return tuple(f"{name}.{axis}" for name in names for axis in "xyz")


def _estimator(*columns: Array) -> Sequence[Array]:
    *vectors, nis, freedom = columns
    position, attitude, p, v, a = (vectors[k : k + 3] for k in range(0, 15, 3))
    nis_a_number = np.where(freedom == 0, np.nan, nis / freedom)
    return (
        1e3 * rms(*(x * x for x in position)),
        DEGREES * rms(*(x * x for x in attitude)),
        nis_a_number,
        1e3 * rms(*p),
        1e3 * rms(*v),
        DEGREES * rms(*a),
        DEGREES * rms(a[2]),
    )


HEALTH = (
    scaled(
        one("thrust", "thrust", "N", "wrench", "actuators/thrust"),
        *xyz("torque", "wrench", "N m", "actuators/torque"),
        one("scaling", "scaling λ", "", "wrench", "actuators/scaling"),
    ),
    scaled(
        *(
            one(f"thrust.{m}", m, "N", "rotor thrust", f"actuators/thrusts[{k}]")
            for k, m in enumerate(MOTORS)
        ),
        *(
            one(f"motor.{m}", m, "count", "motor reference", f"actuators/motor_references[{k}]")
            for k, m in enumerate(MOTORS)
        ),
    ),
    scaled(
        one("mass", "mass", "kg", "estimator", "estimator/mass"),
        *xyz("bias.accelerometer", "accelerometer bias", "m/s²", "estimator/accelerometer_bias"),
        *xyz("bias.gyroscope", "gyroscope bias", "°/s", "estimator/gyroscope_bias", DEGREES),
        one("measurement.age", "pose age", "ms", "estimator", "estimator/measurement_age", MILLI),
        *(
            one(
                f"measurements.{kind}",
                f"measurements {kind}",
                "",
                "estimator",
                f"estimator/measurements_{kind}",
            )
            for kind in ("used", "refused", "ignored")
        ),
    ),
    scaled(
        one("consistency", "consistency", "", "adaptation", "estimator/consistency"),
        one("refused.share", "refused", "%", "adaptation", "estimator/refused_share", 100.0),
        *(
            one(f"noise.{kind}", f"{kind} ×", "", "adaptation", f"estimator/{kind}_noise_scale")
            for kind in ("accelerometer", "gyroscope", "measurement")
        ),
    ),
    Source(
        "estimator",
        (
            *_axes(
                "position_innovation",
                "attitude_innovation",
                "position_variance",
                "velocity_variance",
                "attitude_variance",
            ),
            "nis",
            "nis_freedom",
        ),
        (
            Signal("innovation.position", "position", "mm", "innovation", "estimator"),
            Signal("innovation.attitude", "attitude", "°", "innovation", "estimator"),
            Signal("nis", "NIS per degree of freedom", "", "innovation", "estimator"),
            Signal("deviation.position", "position", "mm", "rms deviation", "estimator"),
            Signal("deviation.velocity", "velocity", "mm/s", "rms deviation", "estimator"),
            Signal("deviation.attitude", "attitude", "°", "rms deviation", "estimator"),
            Signal("deviation.heading", "heading", "°", "rms deviation", "estimator"),
        ),
        function=_estimator,
    ),
    scaled(
        one("loop.rate", "rate", "Hz", "flight loop", "status/tick_rate"),
        one("loop.lateness_p50", "lateness p50", "µs", "flight loop", "status/lateness_p50", MICRO),
        one("loop.lateness_p99", "lateness p99", "µs", "flight loop", "status/lateness_p99", MICRO),
        one("loop.missed", "missed", "%", "flight loop", "status/missed_share", 100.0),
    ),
    scaled(  # apart from those above: earlier logs do not have them
        one("board.commands", "commands", "Hz", "board link", "status/board_command_rate"),
        one("board.round_trip", "round trip", "ms", "board link", "status/board_round_trip", MILLI),
        one(
            "board.acknowledged",
            "acknowledged",
            "%",
            "board link",
            "status/board_acknowledged",
            100.0,
        ),
    ),
    scaled(
        one("link.age", "age", "ms", "link", "link_status/age", MILLI),
        one("link.round_trip", "round trip", "ms", "link", "link_status/round_trip", MILLI),
        one("link.jitter", "jitter", "ms", "link", "link_status/jitter", MILLI),
        one("link.loss", "loss", "%", "link", "link_status/loss", 100.0),
        one("link.rate", "telemetry", "Hz", "link", "link_status/telemetry_rate"),
        one(
            "link.clock_offset",
            "clock offset",
            "ms",
            "vehicle clock",
            "link_status/clock_offset",
            MILLI,
        ),
    ),
    scaled(one("battery.voltage", "voltage", "V", "battery", "battery/voltage")),
)
