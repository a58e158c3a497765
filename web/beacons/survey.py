"""Surveys of the beacons from recorded flights: requested, judged, accepted or rejected.

The survey itself, which an extension offers, runs in a separate process, because it flies the run
some hundred times. An accepted layout is set like any other: station and vehicle check it.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from fastapi import FastAPI
from pydantic import Field

from bearing_sim.beacons import Beacons, format_layout, parse_layout
from flight_log.file import is_being_written
from quadrotor.errors import RefusedError, os_errors
from quadrotor.extension import LayoutSurvey
from quadrotor.extensions import registry
from quadrotor.json_object import JsonObject
from web.access.requester import Operator
from web.body import Body
from web.feature import Feature
from web.parameters.replica import LAYOUT
from web.runs.job_queue import Work, Workshop

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext

SECONDS = 1800.0
"""Longest time of one survey, s."""


@dataclass
class SurveyedBeacon:
    """Surveyed position of a beacon, its distance from the flight's layout, and deviations; m."""

    id: int
    position_w: list[float]
    moved_w: list[float]
    deviation_w: list[float]


@dataclass
class LayoutProposal:
    """Layout found by a survey.

    Attributes:
        began: the flight's layout, as `bearing_sim.beacons.parse_layout` reads it.
        before, after: bearing residuals of the error-state filter with that layout and with the one
            found, rad rms.
    """

    began: str
    beacons: list[SurveyedBeacon]
    before: float
    after: float

    @property
    def layout(self) -> str:
        """Return the layout found, in the form of the parameter."""
        ids, places = [one.id for one in self.beacons], [one.position_w for one in self.beacons]
        return format_layout(Beacons(ids, places))


SurveyRun = Callable[..., LayoutProposal]
"""Job (vehicle_link.jobs) that reads the log and reports its progress, 0 to 1."""


class SurveyBody(Body):
    run_id: str = Field(min_length=1, max_length=200, description="the flight")


class BeaconSurvey:
    """Newest survey of one vehicle; thread-safe.

    Args:
        survey: the job that makes a survey; None refuses every request.
    """

    def __init__(self, survey: SurveyRun | None) -> None:
        self._workshop = None if survey is None else Workshop(survey, "surveys", SECONDS)
        self._lock = threading.Lock()
        self._work = Work("none")
        self._run_id = self._decision = ""

    def ask(self, run_id: str, log: Path) -> None:
        """Start a survey, which replaces the previous one. Raises RefusedError, StorageError."""
        with os_errors(lambda why: f"cannot read {log}: {why}"):
            if is_being_written(log):
                raise RefusedError(f"run {run_id} is being recorded; survey it when it has ended")
        with self._lock:
            if self._workshop is None:
                raise RefusedError("this page makes no surveys; start it with `quadlab`")
            if self._work.is_under_way:
                raise RefusedError(f"run {self._run_id} is being surveyed; wait for its end")
            work = Work()
            self._workshop.put(work, (log,))
            self._work, self._run_id, self._decision = work, run_id, ""

    def proposal(self) -> LayoutProposal:
        """Return the proposal that waits for a decision. Raises RefusedError if there is none."""
        with self._lock:
            if self._decision:
                raise RefusedError(f"the survey of run {self._run_id} is {self._decision} already")
            if self._work.name != "ready":
                raise RefusedError("there is no survey to accept; survey a flight first")
            proposal: LayoutProposal = self._work.result
            return proposal

    def decide(self, decision: str) -> None:
        """Store the decision on the proposal: accepted or rejected. Raises RefusedError."""
        self.proposal()
        with self._lock:
            self._decision = decision

    def as_json(self) -> JsonObject:
        """Return the state for the page: places in m, moves in mm, residuals in mrad."""
        with self._lock:
            work, proposal = self._work, self._work.result
            return {
                "state": work.name,
                "progress": round(work.progress, 3),
                "reason": work.reason,
                "run_id": self._run_id,
                "decision": self._decision,
                "proposal": None if proposal is None else _fields(proposal),
            }

    def stop(self) -> None:
        if self._workshop is not None:
            self._workshop.stop()


def _fields(proposal: LayoutProposal) -> JsonObject:
    return {
        "began": proposal.began,
        "layout": proposal.layout,
        "before": round(1e3 * proposal.before, 3),
        "after": round(1e3 * proposal.after, 3),
        "beacons": [
            {
                "id": one.id,
                "position": one.position_w,
                "moved": [round(1e3 * along, 1) for along in one.moved_w],
                "deviation": round(1e3 * max(one.deviation_w), 1)
                if all(map(math.isfinite, one.deviation_w))
                else None,
            }
            for one in proposal.beacons
        ],
    }


def offered() -> SurveyRun | None:
    """Return the survey that an extension offers, None without one."""
    surveys = list(registry().offers(LayoutSurvey).values())
    return surveys[0].load() if surveys else None


def new_feature() -> Feature:
    return Feature(partial(add_survey, run=offered()))


def add_survey(app: FastAPI, context: VehicleContext, run: SurveyRun | None) -> None:
    """Add the routes below /api/beacons/survey."""
    survey = BeaconSurvey(run)
    context.closing.callback(survey.stop)

    @app.get("/api/beacons/survey")
    def state() -> JsonObject:
        """Return the newest survey: none, waiting, working, ready or failed, and its proposal.

        Places are in m, moves and deviations in mm, residuals in mrad.
        """
        return survey.as_json()

    @app.post("/api/beacons/survey")
    def begin(body: SurveyBody, _: Operator) -> JsonObject:
        """Find the beacons' positions from a recorded flight; nothing changes until accepted."""
        survey.ask(body.run_id, context.catalogue.resolve(body.run_id))
        return survey.as_json()

    @app.post("/api/beacons/survey/accept")
    async def accept(session: Operator) -> JsonObject:
        """Set the proposed layout; station and vehicle check it."""
        proposal, in_use = survey.proposal(), context.replica.value(LAYOUT)
        if isinstance(in_use, str):
            ours, found = (
                sorted(map(int, parse_layout(one).ids)) for one in (in_use, proposal.layout)
            )
            if ours != found:
                raise RefusedError(
                    f"the survey is of beacons {_listed(found)}, but those in use are "
                    f"{_listed(ours)}: survey a flight with these"
                )
        await context.gains.change({LAYOUT: proposal.layout}, session.label)
        survey.decide("accepted")
        return survey.as_json()

    @app.post("/api/beacons/survey/reject")
    def reject(_: Operator) -> JsonObject:
        """Reject the proposal; the layout does not change."""
        survey.decide("rejected")
        return survey.as_json()


def _listed(ids: list[int]) -> str:
    return ", ".join(map(str, ids))
