"""Poses of single frames of bearings, and the estimators compared against the truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from web.signals.plain import Leaf, leaves, reader
from web.signals.signal import Signal, Source, one, rms, vector, xyz

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

_RESULT = "quadlab_msgs/EstimatorResult"


def _bearing_pose(m: Any) -> Sequence[float]:
    covariance = m.pose.covariance  # 6 by 6, position first
    return (*vector(m.pose.pose.position), 1e3 * rms(covariance[0], covariance[7], covariance[14]))


def _comparison(m: Any) -> Sequence[float]:
    errors, angles, deviations = ([math.nan] * len(COMPARED) for _ in range(3))
    for result in m.estimators:
        if result.name not in COMPARED:
            continue
        i, covariance = COMPARED.index(result.name), result.position_covariance
        errors[i] = 1e3 * result.position_error
        angles[i] = math.degrees(result.attitude_error)
        deviations[i] = 1e3 * rms(covariance[0], covariance[4], covariance[8])
    bounds = (1e3 * m.position_bound, math.degrees(m.attitude_bound))
    return (*errors, bounds[0], *angles, bounds[1], *deviations)


def _compared(name: str, group: str, unit: str) -> list[Signal]:
    return [Signal(f"comparison.{name}.{of}", of, unit, group, "comparison") for of in COMPARED]


def _bound(of: str, unit: str) -> Signal:
    group = f"{of} error to truth"
    return one(f"comparison.{of}_bound", "one-frame bound", unit, group, "comparison")


def _results() -> tuple[Source, ...]:
    """Return the sources of everything else that is published of an estimator, one each."""
    plain = leaves(_RESULT, covered=("position_error", "attitude_error"))

    def source(name: str) -> Source:
        signals = tuple(
            Signal(
                f"comparison.{name}.{leaf.name}",
                leaf.label,
                leaf.unit,
                f"{name} {leaf.group}".strip(),
                "comparison",
            )
            for leaf in plain
        )
        return Source(("comparison",), signals, _of(name, plain))

    return tuple(source(name) for name in COMPARED)


def _of(name: str, plain: Sequence[Leaf]) -> Callable[[Any], Sequence[float]]:
    read, none = reader(plain), [math.nan] * len(plain)

    def values(m: Any) -> Sequence[float]:
        result = next((r for r in m.estimators if r.name == name), None)
        return none if result is None else read(result)

    return values


ESTIMATES = (
    Source(
        ("bearing_pose",),
        (
            *xyz("bearing_pose.position", "one-frame position", "m", "bearing_pose"),
            one("bearing_pose.deviation", "rms", "mm", "one-frame deviation", "bearing_pose"),
        ),
        _bearing_pose,
        covers=("bearing_pose.pose.pose.position",),
    ),
    Source(
        ("comparison",),
        (
            *_compared("position_error", "position error to truth", "mm"),
            _bound("position", "mm"),
            *_compared("attitude_error", "attitude error to truth", "°"),
            _bound("attitude", "°"),
            *_compared("deviation", "rms deviation an estimator states", "mm"),
        ),
        _comparison,
        covers=("comparison.position_bound", "comparison.attitude_bound", "comparison.estimators"),
    ),
)

RESULTS = _results()
