"""The state of the station's experiment, published as `experiment_status`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from console.experiments.readings import Progress
from vehicle_link.clock import monotonic
from vehicle_link.messages import header, new
from vehicle_link.messages.records import ExperimentStatus

IDLE, FLYING, FINISHING, EVALUATING = "idle", "flying", "finishing", "evaluating"
STOPPED, REFUSED = "stopped", "refused"
RUNNING = (FLYING, FINISHING, EVALUATING)
IN_THE_AIR = (FLYING, FINISHING)
ACCEPTED, REJECTED = "accepted", "rejected"
NO_PROGRESS = Progress("")
STEPS_MAX, LIVE_MAX = 9999, 200

SENT_AS_THEY_ARE = (
    *("name", "phase", "step", "requester", "planned", "reason", "run_id", "verdict"),
    *("question", "proposal", "decision"),
)
"""Fields of the state that the message has under the same name."""


@dataclass
class ExperimentState:
    """The state of one experiment, written under the publisher's lock; times in s, monotonic."""

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
    progress: Progress = NO_PROGRESS
    question: str = ""
    proposal: str = ""
    decision: str = ""
    started: float = 0.0
    ended: float | None = None

    @property
    def running(self) -> bool:
        return self.phase in RUNNING

    def message(self, stamp_ns: int, manual: bool) -> ExperimentStatus:
        """Return quadlab_msgs/ExperimentStatus."""
        until = monotonic() if self.ended is None else self.ended
        progress = self.progress
        return new(
            "quadlab_msgs/ExperimentStatus",
            header=header(stamp_ns),
            **{name: getattr(self, name) for name in SENT_AS_THEY_ARE},
            manual=manual,
            elapsed=until - self.started if self.name else 0.0,
            metric_names=list(self.metrics),
            metric_values=list(self.metrics.values()),
            metric_limits=[self.limits.get(name, math.nan) for name in self.metrics],
            reports=list(self.reports),
            instruction=progress.instruction,
            step_number=progress.number,
            step_count=progress.count,
            step_share=progress.share,
            live_names=list(progress.live),
            live_values=[value for value, _ in progress.live.values()],
            live_units=[unit for _, unit in progress.live.values()],
        )


def plain(progress: Progress) -> Progress:
    """Return progress as plain numbers, whatever number types a script reported.

    Raises TypeError or ValueError for other values.
    """
    share = float(progress.share)
    live = list(progress.live.items())[:LIVE_MAX]
    return Progress(
        str(progress.instruction),
        min(max(int(progress.number), 0), STEPS_MAX),
        min(max(int(progress.count), 0), STEPS_MAX),
        min(max(share, 0.0), 1.0) if math.isfinite(share) else 0.0,
        {str(name): (float(value), str(unit)) for name, (value, unit) in live},
    )
