"""The results of a comparison, published ten times a second."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from extensions.comparison.statistics import NOTHING, Summary
from quadrotor.records import Array
from vehicle_link.messages import header, new
from vehicle_link.messages.records import EstimatorComparison, EstimatorResult

UNKNOWN = np.full(13, math.nan)


@dataclass
class Result:
    """Result of one estimator; fields as in quadlab_msgs/EstimatorResult."""

    name: str
    initialized: bool = False
    converged: bool = False
    state: Array = field(default_factory=lambda: UNKNOWN)  # the 13 numbers of a STATE
    position_covariance: Array = field(default_factory=lambda: np.full(9, math.nan))
    attitude_variance: float = math.nan
    position_error: float = math.nan
    attitude_error: float = math.nan
    recent: Summary = NOTHING
    session: Summary = NOTHING
    processor: float = math.nan
    beacon_ids: list[int] = field(default_factory=list)
    residuals: list[float] = field(default_factory=list)


@dataclass
class Comparison:
    """A comparison with the fields of quadlab_msgs/EstimatorComparison."""

    stamp_ns: int
    truth: str
    duration: float
    results: Sequence[Result]
    sigma: float = math.nan
    position_bound: float = math.nan
    attitude_bound: float = math.nan


def message_of(comparison: Comparison) -> EstimatorComparison:
    """Return the quadlab_msgs/EstimatorComparison."""
    fields = dict(vars(comparison))
    stamp_ns, results = fields.pop("stamp_ns"), fields.pop("results")
    estimators = [_result(one) for one in results]
    return new(
        "quadlab_msgs/EstimatorComparison", header=header(stamp_ns), estimators=estimators, **fields
    )


def _result(result: Result) -> EstimatorResult:
    fields = dict(vars(result))
    x, y, z, u, v, w, qw, qx, qy, qz = fields.pop("state")[:10].tolist()
    for when, summary in (("_recent", fields.pop("recent")), ("", fields.pop("session"))):
        for name, value in summary._asdict().items():
            what, kind = name.split("_")
            fields[f"{what}_{kind}{when}"] = value
    pose = {"position": (x, y, z), "orientation": (qx, qy, qz, qw)}
    return new("quadlab_msgs/EstimatorResult", pose=pose, velocity=(u, v, w), **fields)
