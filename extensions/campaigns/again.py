"""A row flown again with its log, which becomes a run of the catalogue: the same flight."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from console.catalogue.catalogue import Catalogue
from console.runs.adoption import described
from extensions.campaigns.flights import fly_task
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.plan import COMPILED
from flight_log.run_folder import STATION
from quadrotor.errors import StorageError, UsageError, os_errors
from quadrotor.json_object import JsonObject
from web.runs.job_queue import Work, Workshop

SECONDS = 3600.0
"""Longest time of one flight."""


def fly_again(path: Path, index: int, run: Path, report: Callable[[float], None]) -> None:
    """Fly a row and write its log as a run's folder; this is the job. Raises QuadlabError."""
    folder = CampaignFolder(path)
    place = folder.log_of(index)
    if not place.exists():
        (outcome,) = fly_task(folder.task([index], keep_logs=True))
        if outcome.log is None:
            raise StorageError(f"flight {index} has no log: {outcome.reason or outcome.verdict}")
        folder.add_log(outcome)
    new = run.with_name(f".{run.name}.new")
    with os_errors(lambda why: f"{run} cannot be written ({why})"):
        shutil.rmtree(new, ignore_errors=True)
        new.mkdir()
        shutil.copyfile(place, new / STATION)
        new.rename(run)
    report(1.0)


def has_logs(folder: CampaignFolder) -> bool:
    """Return whether a flight of this campaign has a log that a run can be made of."""
    plan = folder.plan.plan
    return not plan.logs and plan.vehicles == 1 and plan.experiment != COMPILED


@dataclass(slots=True)
class Again(Work):
    """State of a flight that is flown again, and the name of its run."""

    run: str = ""

    def as_json(self) -> JsonObject:
        return {"state": self.name, "reason": self.reason, "run": self.run}


class FlyingAgain(Workshop):
    """The rows that the page has asked for, flown one after the other; safe for several threads."""

    def __init__(
        self,
        catalogue: Catalogue,
        function: Callable[..., None] = fly_again,
        seconds: float = SECONDS,
    ) -> None:
        super().__init__(function, "flights", seconds)
        self._catalogue = catalogue
        self._asking = threading.Lock()
        self._asked: dict[str, Again] = {}

    def ask(self, folder: CampaignFolder, index: int) -> Again:
        """Start a flight, unless it is under way, or its run is there.

        Raises RefusedError while too many wait; UsageError for a row without a log, and for one of
        another quadlab, which would be another flight.
        """
        if not 0 <= index < folder.flights:
            raise UsageError(f"there is no flight {index}: {folder.path.name} has {folder.flights}")
        if not has_logs(folder):
            raise UsageError("only flights of one vehicle of the whole stack have a log")
        run = self._catalogue.folder / f"{folder.path.name}_{index:07}"
        with self._asking:
            known = self._asked.get(run.name)
            if known is not None and (known.is_under_way or run.exists()):
                return known
            again = self._asked[run.name] = Again(run=run.name)
            if run.exists():
                again.name = "ready"
                return again
            folder.check_alike()
            self.put(again, (folder.path, index, run), lambda why: why or self._entered(run))
            return again

    def _entered(self, run: Path) -> str:
        self._catalogue.add(described(run, None))
        return ""
