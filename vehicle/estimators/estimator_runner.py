"""One estimator that runs on board, with its source and its outputs."""

from __future__ import annotations

import numpy as np

from estimation.estimator import Estimator
from quadrotor.records import ESTIMATE, POSE_SAMPLE, Record, new_state, pose_sample
from vehicle.estimators.measurement_reports import UnusedMeasurements

POSES, BEARINGS, BOTH = "poses", "bearings", "both"
NEWS_NS = 1_000_000_000
"""Least time between two lines of one estimator: a diverging filter restarts twice a second."""


class Runner:
    """An estimator, in use or running in parallel.

    Args:
        name: in `estimation.registry`.
        source: "poses", "bearings" or "both".

    Attributes:
        state, estimate: STATE and ESTIMATE (1,) of one that is not in use.
        plugged: whether it is a plugin, about which nothing is known from its name.
    """

    def __init__(self, name: str, source: str, estimator: Estimator, plugged: bool = False) -> None:
        self.name, self.source, self.estimator, self.plugged = name, source, estimator, plugged
        self.state, self.estimate = new_state(), np.zeros(1, ESTIMATE)
        self._last_pose_ns = -(1 << 62)
        self._unused = UnusedMeasurements()
        self._reported_ns = -(1 << 62)

    def __str__(self) -> str:
        return f"{self.name} on {self.source}"

    @property
    def built_in(self) -> Runner | None:
        """Return the built-in one beneath a plugin."""
        found: Runner | None = getattr(self.estimator, "built_in", None)
        return found

    def is_(self, name: str, source: str) -> bool:
        return self.name == name and self.source == source

    def feed(self, source: str) -> None:
        """Use measurements of another source from now on."""
        self.source = source
        if self.built_in is not None:
            self.built_in.source = source

    def wants(self, measurement: Record, now_ns: int, timeout_ns: int) -> bool:
        """Return whether the estimator takes this POSE_SAMPLE or BEARINGS_SAMPLE.

        A filter with fixed gains would weight bearings like poses, so it gets one or the other.
        """
        if measurement.dtype == POSE_SAMPLE:
            if self.source == BEARINGS:
                return False
            self._last_pose_ns = now_ns
            return True
        if self.source != BOTH or self.estimator.deviations is not None:
            return self.source != POSES
        return now_ns - self._last_pose_ns > timeout_ns

    def correct(self, measurement: Record, estimate: Record) -> None:
        """Apply the measurement. Raises MeasurementError."""
        if measurement.dtype == POSE_SAMPLE:
            self.estimator.correct(measurement, estimate)
        else:
            self.estimator.correct_bearings(measurement, estimate)

    def start_at(self, stamp_ns: int, state: Record) -> None:
        """Start at the pose of a STATE (1,). Raises MeasurementError."""
        self.estimator.initialize(
            pose_sample(stamp_ns, state["position_w"][0], state["quaternion_wb"][0])
        )

    def unused(self, now_ns: int) -> str | None:
        """Return a line about measurements not used because of their time, when that is new."""
        return self._unused.check(self, self.estimator, now_ns)

    def restarts(self, now_ns: int) -> str | None:
        """Report that the estimator diverged and restarted, for one that is not in
        use.
        """
        lines: list[str] = getattr(self.estimator, "restarts", [])
        if not lines or now_ns - self._reported_ns < NEWS_NS:
            return None
        self._reported_ns = now_ns
        line = lines[-1] + (f" ({len(lines)} times)" if len(lines) > 1 else "")
        lines.clear()
        return line
