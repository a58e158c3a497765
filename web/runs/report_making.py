"""Reports of runs, made on request, because plots take seconds."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from console.runs.report_folders import FILE_NAME, report_folder
from quadrotor.json_object import JsonObject
from web.runs.job_queue import Work, Workshop, check_closed

SECONDS = 300.0
"""Longest time for one report, s."""
REMEMBERED = 200


@dataclass(slots=True)
class Making(Work):
    """State of a requested report."""

    def as_json(self, log: Path) -> JsonObject:
        """Return the fields, and the names of the files that exist."""
        return {
            "state": self.name,
            "progress": round(self.progress, 3),
            "reason": self.reason,
            "files": files_of(log),
        }


def make_report(log: Path, report: Callable[[float], None]) -> None:
    """Write a run's report next to its result; this is the job."""
    from console.reports.writer import report_writer  # not needed by the page

    report_writer()(log, report_folder(log), progress=report)


class ReportMaking(Workshop):
    """Reports of runs made on request; safe for several threads.

    Args:
        function: called with the log.
    """

    def __init__(
        self, function: Callable[..., None] = make_report, seconds: float = SECONDS
    ) -> None:
        super().__init__(function, "reports", seconds)
        self._asking = threading.Lock()
        self._asked: dict[str, Making] = {}

    def ask(self, run_id: str, log: Path) -> Making:
        """Start making a report, also if there is one, unless one is in progress.

        Raises RefusedError while the run is being recorded or too many wait, StorageError.
        """
        check_closed(run_id, log, "report")
        with self._asking:
            making = self._asked.get(run_id)
            if making is not None and making.is_under_way:
                return making
            making = Making()
            self.put(making, (log,))
            self._asked.pop(run_id, None)
            self._asked[run_id] = making
            while len(self._asked) > REMEMBERED:
                self._asked.pop(next(iter(self._asked)))
            return making

    def state(self, run_id: str) -> Making:
        """Return the state of the newest requested report; `none` if none was since the start."""
        return self._asked.get(run_id) or Making("none")


def files_of(log: Path) -> list[str]:
    """Return the names of the files in the report's folder, documents first."""
    first = (".html", ".pdf", ".png")
    folder = report_folder(log)
    try:
        names = [path.name for path in folder.iterdir() if path.is_file()]
    except OSError:
        return []
    shown = [name for name in names if FILE_NAME.fullmatch(name) and not name.endswith(".new")]
    return sorted(shown, key=lambda name: (_place(Path(name).suffix, first), name))


def _place(suffix: str, first: tuple[str, ...]) -> int:
    return first.index(suffix) if suffix in first else len(first)
