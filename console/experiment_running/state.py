"""How the station's experiment stands, as `experiment_status` tells it."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from vehicle_link.messages import header, new

IDLE, FLYING, FINISHING, EVALUATING = "idle", "flying", "finishing", "evaluating"
PASSED, FAILED, STOPPED, REFUSED = "passed", "failed", "stopped", "refused"
RUNNING = (FLYING, FINISHING, EVALUATING)
IN_THE_AIR = (FLYING, FINISHING)


@dataclass
class ExperimentState:
    """Written by the runner under its lock; times in s of the monotonic clock."""

    name: str = ""
    phase: str = IDLE
    step: str = ""
    requester: str = ""
    planned: float = 0.0
    reason: str = ""
    run_id: str = ""
    verdict: str = ""
    metrics: Mapping[str, float] = field(default_factory=dict)
    limits: Mapping[str, float] = field(default_factory=dict)
    reports: tuple[str, ...] = ()
    started: float = 0.0
    ended: float | None = None

    @property
    def running(self) -> bool:
        return self.phase in RUNNING

    def message(self, stamp_ns: int, manual: bool) -> Any:
        """quadlab_msgs/ExperimentStatus."""
        until = time.monotonic() if self.ended is None else self.ended
        return new(
            "quadlab_msgs/ExperimentStatus",
            header=header(stamp_ns),
            name=self.name, phase=self.phase, step=self.step, requester=self.requester,
            manual=manual, elapsed=until - self.started if self.name else 0.0,
            planned=self.planned, reason=self.reason, run_id=self.run_id, verdict=self.verdict,
            metric_names=list(self.metrics), metric_values=list(self.metrics.values()),
            metric_limits=[self.limits.get(name, math.nan) for name in self.metrics],
            reports=list(self.reports),
        )  # fmt: skip
