"""Summary of all states, made once for all pages that request it at about the same time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from web.experiments.calibrations import proposal_summary
from web.experiments.experiments import experiment_summary
from web.live.events import Message, summarize
from web.runs.onboard import transfers_summary
from web.setup.preflight import preflight_summary

if TYPE_CHECKING:
    from web.app_parts import Parts

SHARED = 0.05  # s


class Summary:
    """Summary for the page, of one event loop.

    Args:
        clock: s of a steady clock.
    """

    def __init__(self, parts: Parts, clock: Callable[[], float] = time.monotonic) -> None:
        self._parts = parts
        self._clock = clock
        self._made = -math.inf
        self._newest: Message = {}

    def __call__(self) -> Message:
        """Return the summary, which is read-only.

        It has the newest status messages, ages, the experiment and its proposal, control,
        pre-flight, the progress of a trajectory, whether the 3D view shows a planned one, and what
        Emergency land does.
        """
        now = self._clock()
        if now - self._made > SHARED:
            self._newest, self._made = self.fresh(), now
        return self._newest

    def fresh(self) -> Message:
        """Return the summary as of now."""
        parts = self._parts
        return {
            **summarize(parts.live),
            "experiment": experiment_summary(parts.live),
            "proposal": proposal_summary(parts.live),
            "control": parts.control.summary(),
            "transfers": transfers_summary(parts.live),
            "preflight": preflight_summary(parts.live),
            "trajectory": parts.trajectories.summary(),
            "planned": parts.scene.is_plan_shown,
            "emergency_land": parts.replica.value("safety.emergency_land"),
            "pages": parts.hub.pages,
        }
