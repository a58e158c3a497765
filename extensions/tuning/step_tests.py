"""Step tests, one at a time: fly it, read its ticks from the vehicle's log, judge and store it.

A test continues when the page that requested it is closed. It uses no telemetry: what the log lacks
is a gap, or a failure with its reason.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

from control.trajectories.multistep import LEAD
from extensions.tuning.collection import Collection, Samples
from extensions.tuning.evaluation import COLUMNS, Plan, evaluate
from extensions.tuning.step_test_store import StepTest, StepTestStore
from quadrotor.errors import LinkError, QuadlabError, RefusedError
from quadrotor.parameter_description import ParameterValue
from vehicle_link.messages import stamp_of
from web.latest import Live
from web.live.events import EventHub
from web.live.station import Station
from web.parameters.replica import PageParameters

log = logging.getLogger("quadlab.web")

BEHAVIOR = "excite"
GAINS = ("control.", "estimation.")
LOOK = 0.05  # s between two checks of the vehicle's status
STARTS_WITHIN_NS = 3_000_000_000  # of the vehicle's clock; a status after that shows a new test
PATIENCE = 10.0  # s beyond the planned end
AFTER_NS = 350_000_000
RETRY = 0.25  # s
ENDS_WELL = ("hover",)


class StepTests:
    """Bench for step tests, to be used from the event loop's thread.

    It publishes `{"type": "tuning", …}` to all pages.
    """

    def __init__(
        self,
        station: Station,
        live: Live,
        replica: PageParameters,
        hub: EventHub,
        kept: StepTestStore,
        vehicle: str,
    ) -> None:
        self._station = station
        self._live = live
        self._replica = replica
        self._hub = hub
        self.kept = kept
        self._vehicle = vehicle
        self._task: asyncio.Task[None] | None = None
        self._starting = False
        self.status: dict[str, Any] = {"phase": "idle", "text": "", "share": 0.0, "id": ""}

    @property
    def busy(self) -> bool:
        return self._starting or (self._task is not None and not self._task.done())

    def gains(self) -> dict[str, ParameterValue]:
        """Return the gains in force, as the vehicle confirmed them."""
        return {
            name: value for name, value in self._replica.values().items() if name.startswith(GAINS)
        }

    async def start(self, plan: Plan, requester: str) -> None:
        """Start a test; return once the vehicle accepts. Raises RefusedError or LinkError."""
        if self.busy:
            raise RefusedError("a step test is running; wait for its end, or brake")
        status = self._live.current("status")
        if status is None:
            raise LinkError("the vehicle's status is out of date; a test needs the link")
        begin_ns = stamp_of(status)
        gains = self.gains()
        self._starting = True
        try:
            await self._station.command(
                "start_behavior", requester, name=BEHAVIOR, arguments=asdict(plan)
            )
        finally:
            self._starting = False
        self._task = asyncio.create_task(self._run(plan, requester, begin_ns, gains))

    # ------------------------------------------------------------------ the test
    async def _run(
        self, plan: Plan, requester: str, begin_ns: int, gains: Mapping[str, ParameterValue]
    ) -> None:
        started = datetime.now(UTC).isoformat(timespec="milliseconds")
        station = self._live.newest("station_status")
        try:
            end_ns, followed_by = await self._fly(plan, begin_ns)
            samples = await self._fetch(requester, begin_ns, end_ns)
            self._tell("evaluating", "judging it", 1.0)
            found = await asyncio.to_thread(evaluate, samples, plan)
            problems = list(found.problems)
            if followed_by not in ENDS_WELL:
                problems.append(f"it was stopped by {followed_by}; the events say why")
            now = self.gains()
            run = StepTest(
                id=self.kept.new_id(self._vehicle),
                started=started,
                vehicle=self._vehicle,
                requester=requester,
                run_id=str(station.run_id) if station else "",
                plan=plan,
                gains=dict(gains),
                changed=[n for n, v in gains.items() if now.get(n) != v],
                figures=found.figures,
                edges=found.edges,
                problems=problems,
                file=samples.file,
                rate=samples.rate,
            )
            if run.changed:
                run.problems.append(f"changed while it flew: {', '.join(run.changed)}")
            await asyncio.to_thread(self.kept.keep, run, samples)
            self._tell("done", "; ".join(problems), 1.0, run.id)
        except QuadlabError as error:
            self._tell("failed", str(error), 0.0)
        except Exception as error:
            log.exception("step test")
            self._tell("failed", f"defect, see the log of quadlab web: {error!r}", 0.0)

    async def _fly(self, plan: Plan, begin_ns: int) -> tuple[int, str]:
        """Wait for the end; return the last stamp needed from the log, and the next behavior."""
        planned = LEAD + plan.edges * plan.duration
        began = time.monotonic()
        seen = False
        while True:
            elapsed = time.monotonic() - began
            status = self._live.current("status")
            flies = status is not None and status.behavior == BEHAVIOR
            seen = seen or flies
            # An old status that arrives late is not the end.
            shown = seen or (status and stamp_of(status) > begin_ns + STARTS_WITHIN_NS)
            if status is not None and not flies and shown:
                return stamp_of(status) + AFTER_NS, str(status.behavior)
            if elapsed > planned + PATIENCE:
                raise LinkError(
                    "the vehicle did not show the end of the test; its own log has it, from the "
                    "next start of the station on"
                    if status is None
                    else f"the test still runs {PATIENCE:.0f} s after its planned end"
                )
            where = "" if status is not None else "; no status arrives, the vehicle keeps flying"
            share = min(1.0, elapsed / planned)
            self._tell("flying", f"{elapsed:.0f} of {planned:.0f} s{where}", share)
            await asyncio.sleep(LOOK)

    async def _fetch(self, requester: str, begin_ns: int, end_ns: int) -> Samples:
        """Return every tick between these stamps. Raises StorageError when none can be read."""
        collection = Collection(COLUMNS, begin_ns, end_ns)
        while not collection.done:
            self._tell("fetching", f"{100 * collection.share:.0f} %", collection.share)
            try:
                answer = await self._station.command(
                    "onboard_log", requester, **collection.question
                )
                collection.add(answer)
            except (LinkError, RefusedError) as error:
                if collection.failed(str(error)):
                    await asyncio.sleep(RETRY)
        return collection.result()

    def kept_changed(self) -> None:
        """Notify all pages, from any thread, to read the list again."""
        self._hub.publish_from_thread({"type": "tuning", "status": self.status, "runs": True})

    def _tell(self, phase: str, text: str, share: float, kept: str = "") -> None:
        status = {"phase": phase, "text": text, "share": round(share, 2), "id": kept}
        if status != self.status:
            self.status = status
            self._hub.publish({"type": "tuning", "status": status, "runs": phase == "done"})
