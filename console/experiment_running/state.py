"""The state of the station's experiment, as in `experiment_status`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from console.experiments.readings import Progress
from vehicle_link.clock import monotonic
from vehicle_link.messages import header, new

IDLE, FLYING, FINISHING, EVALUATING = "idle", "flying", "finishing", "evaluating"
PASSED, FAILED, NOT_JUDGED = "passed", "failed", "not_judged"
STOPPED, REFUSED = "stopped", "refused"
RUNNING = (FLYING, FINISHING, EVALUATING)
IN_THE_AIR = (FLYING, FINISHING)
ACCEPTED, REJECTED = "accepted", "rejected"
NOTHING_TOLD = Progress("")
STEPS_MAX, LIVE_MAX = 9999, 200


@dataclass
class ExperimentState:
    """Written under the board's lock; times in s of the monotonic clock."""

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
    progress: Progress = NOTHING_TOLD
    question: str = ""
    proposal: str = ""
    decision: str = ""
    started: float = 0.0
    ended: float | None = None

    @property
    def running(self) -> bool:
        return self.phase in RUNNING

    def message(self, stamp_ns: int, manual: bool) -> Any:
        """Return quadlab_msgs/ExperimentStatus."""
        until = monotonic() if self.ended is None else self.ended
        told = self.progress
        return new(
            "quadlab_msgs/ExperimentStatus",
            header=header(stamp_ns),
            name=self.name,
            phase=self.phase,
            step=self.step,
            requester=self.requester,
            manual=manual,
            elapsed=until - self.started if self.name else 0.0,
            planned=self.planned,
            reason=self.reason,
            run_id=self.run_id,
            verdict=self.verdict,
            metric_names=list(self.metrics),
            metric_values=list(self.metrics.values()),
            metric_limits=[self.limits.get(name, math.nan) for name in self.metrics],
            reports=list(self.reports),
            instruction=told.instruction,
            step_number=told.number,
            step_count=told.count,
            step_share=told.share,
            question=self.question,
            live_names=list(told.live),
            live_values=[value for value, _ in told.live.values()],
            live_units=[unit for _, unit in told.live.values()],
            proposal=self.proposal,
            decision=self.decision,
        )


def plain(told: Progress) -> Progress:
    """Return progress as a message can carry it, whatever kinds of numbers a script reported.

    Raises TypeError or ValueError for what is none.
    """
    share = float(told.share)
    live = list(told.live.items())[:LIVE_MAX]
    return Progress(
        str(told.instruction),
        min(max(int(told.number), 0), STEPS_MAX),
        min(max(int(told.count), 0), STEPS_MAX),
        min(max(share, 0.0), 1.0) if math.isfinite(share) else 0.0,
        {str(name): (float(value), str(unit)) for name, (value, unit) in live},
    )
