"""Signals of poses from single frames of bearings, and of the estimators in the comparison."""

from __future__ import annotations

from collections.abc import Sequence

from web.signals.motion import DEGREES
from web.signals.plain import leaves
from web.signals.signal import Array, Scaled, Signal, Source, one, rms, scaled, xyz

COMPARED = (
    "vehicle",
    "error_state",
    "complementary",
    "complementary:paper",
    "complementary:bearings",
    "complementary:resolved",
)
"""Results of the topic `comparison` that have signals.

They are the vehicle's own estimate, and every built-in estimator and preset of gains. A registered
one has its row in the Beacons tab and no signal.
"""

_RESULT = "quadlab_msgs/EstimatorResult"


def _deviation(*variances: Array) -> Sequence[Array]:
    return (1e3 * rms(*variances),)


def _compared(of: str) -> Source:
    position = f"comparison.position_error.{of}", of, "mm", "position error to truth"
    attitude = f"comparison.attitude_error.{of}", of, "°", "attitude error to truth"
    return scaled(
        one(*position, "comparison/position_error", 1e3),
        one(*attitude, "comparison/attitude_error", DEGREES),
        member=of,
    )


def _stated(of: str) -> Source:
    group = "rms deviation an estimator states"
    return Source(
        "comparison",
        tuple(f"position_covariance[{k}]" for k in (0, 4, 8)),
        (Signal(f"comparison.deviation.{of}", of, "mm", group, "comparison"),),
        function=_deviation,
        member=of,
    )


def _bound(of: str, unit: str, factor: float) -> Scaled:
    name, group = f"comparison.{of}_bound", f"{of} error to truth"
    return one(name, "one-frame bound", unit, group, f"comparison/{of}_bound", factor)


def _results(of: str) -> Source:
    """Return the source of all other numbers that are published for an estimator."""
    rows = [
        Scaled(
            Signal(
                f"comparison.{of}.{leaf.name}",
                leaf.label,
                leaf.unit,
                f"{of} {leaf.group}".strip(),
                "comparison",
            ),
            leaf.column,
        )
        for leaf in leaves(_RESULT, covered=("position_error", "attitude_error"))
    ]
    return scaled(*rows, member=of)


ESTIMATES = (
    scaled(
        *xyz("bearing_pose.position", "one-frame position", "m", "bearing_pose/pose.pose.position")
    ),
    Source(
        "bearing_pose",
        tuple(f"pose.covariance[{k}]" for k in (0, 7, 14)),  # 6 by 6, position first
        (Signal("bearing_pose.deviation", "rms", "mm", "one-frame deviation", "bearing_pose"),),
        function=_deviation,
    ),
    *(_compared(of) for of in COMPARED),
    scaled(_bound("position", "mm", 1e3), _bound("attitude", "°", DEGREES)),
    *(_stated(of) for of in COMPARED),
)

RESULTS = tuple(_results(of) for of in COMPARED)
