"""Recordings for viser, made on request and stored next to the run."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path

from flight_log.run_folder import log_of
from quadrotor.errors import os_errors
from quadrotor.json_object import JsonObject
from web.runs.job_queue import Work, Workshop, check_closed

SECONDS = 1800.0
"""Longest time for one recording, s."""
REMEMBERED = 200


@dataclass(slots=True)
class Export(Work):
    """State of a recording; `path` is set when it is ready."""

    path: Path | None = None

    def as_json(self) -> JsonObject:
        return {"state": self.name, "progress": round(self.progress, 3), "reason": self.reason}


def write_recording(log: Path, file: Path, report: Callable[[float], None]) -> None:
    """Write the recording of a log; this is the job."""
    from web.runs.viser_recording import record  # imports the scene, which the page does not need

    record(log, file, report)


class ViserExports(Workshop):
    """Recordings of runs for viser; safe for several threads.

    Args:
        function: called with the log and the file to write.
    """

    def __init__(self, function: Callable[..., None] = write_recording) -> None:
        super().__init__(function, "recordings", SECONDS)
        self._version = version("viser")  # a recording fits only the client of the same version
        self._asking = threading.Lock()
        self._exports: dict[tuple[str, int], Export] = {}  # by run and age of its log

    def ask(self, run_id: str, log: Path) -> Export:
        """Start making a recording, unless it exists, is in progress or has failed before.

        Raises RefusedError while the run is being recorded or too many wait, StorageError.
        """
        name = f"{log.stem}.{self._version}.viser"
        file = log / name if log.is_dir() else log.with_name(name)
        check_closed(run_id, log, "3D recording")
        with os_errors(lambda why: f"cannot read {log}: {why}"):
            written_ns = log_of(log).stat().st_mtime_ns
        with self._asking:
            if file.exists() and file.stat().st_mtime_ns >= written_ns:
                return Export("ready", 1.0, path=file)
            key = (run_id, written_ns)
            export = self._exports.get(key)
            if export is not None and export.name != "ready":
                return export
            export = Export()
            self.put(export, (log, file), partial(_finish, log, file, export))
            self._exports[key] = export
            while len(self._exports) > REMEMBERED:
                self._exports.pop(next(iter(self._exports)))
            return export


def _finish(log: Path, file: Path, export: Export, reason: str) -> str:
    """Finish an export, and delete a partial file."""
    if not log.exists():
        file.unlink(missing_ok=True)
        return "the run was deleted meanwhile"
    if not reason and file.exists():
        export.path = file
        return ""
    file.with_name(f"{file.name}.new").unlink(missing_ok=True)
    return reason or "the process wrote no file"
