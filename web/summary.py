"""Summary of all states, made once for all pages that request it at about the same time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING

from quadrotor.json_object import JsonObject
from vehicle_link.checks import Check, from_messages
from web.experiments.calibrations import proposal_summary
from web.experiments.experiments import experiment_summary
from web.latest import Live
from web.live.events import Message, summarize
from web.runs.onboard import transfers_summary

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext

SHARED = 0.05  # s


class Summary:
    """Summary for the page, of one event loop.

    Args:
        clock: s of a steady clock.
    """

    def __init__(
        self, context: VehicleContext, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._context = context
        self._clock = clock
        self._made = -math.inf
        self._newest: Message = {}

    def __call__(self) -> Message:
        """Return the summary, which is read-only.

        It has the newest status messages, ages, the experiment and its proposal, control,
        pre-flight, the progress of a trajectory, the tracking error of the behavior that is flown,
        whether the 3D view shows a planned trajectory, what Emergency land does, and what takes
        back the last act on the parameters of this flight.
        """
        now = self._clock()
        if now - self._made > SHARED:
            self._newest, self._made = self.fresh(), now
        return self._newest

    def fresh(self) -> Message:
        """Return the summary as of now."""
        context = self._context
        trajectory = context.trajectories.summary()
        return {
            **summarize(context.live),
            "experiment": experiment_summary(context.live),
            "proposal": proposal_summary(context.live),
            "control": context.control.summary(),
            "transfers": transfers_summary(context.live),
            "preflight": preflight_summary(context.live),
            "trajectory": trajectory,
            "tracking": tracking_summary(context, trajectory),
            "planned": context.scene.is_plan_shown,
            "emergency_land": context.replica.value("safety.emergency_land"),
            "restorable": context.restorable(),
            "pages": context.hub.pages,
        }


def tracking_summary(context: VehicleContext, trajectory: Message | None) -> JsonObject | None:
    """Return the figures of the tracking error of the behavior that is flown, None without one."""
    if trajectory is None:
        return context.tracking.summary()
    return context.tracking.summary(trajectory["laps"], trajectory["duration"] or 0.0)


def preflight_summary(live: Live) -> JsonObject | None:
    """Return the pre-flight list, or None if the station has not sent it for a while."""
    message = live.current("preflight")
    if message is None:
        return None
    return {
        "ready": bool(message.ready),
        "armed": bool(message.armed),
        "blocks": bool(message.blocks),
        "checks": [_listed(one) for one in from_messages(message.checks)],
    }


def _listed(check: Check) -> dict[str, str]:
    """Return a check without its place, which is the same for all; it is sent twice a second."""
    fields = asdict(check)
    fields.pop("place")
    return fields
