"""Reports of runs on request, made one at a time in a process of their own: plots take seconds."""

from __future__ import annotations

import os
import queue
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from console.run_reports import FILE_NAME, report_folder
from quadrotor.errors import RefusedError, StorageError
from vehicle_link.log.file import is_being_written

MODULE = "console.reports"
ROOT = Path(__file__).parents[2]
SECONDS = 300.0
"""One report may take."""
WAITING = 20
"""Reports that may wait for their turn."""
REMEMBERED = 200

Name = Literal["none", "waiting", "working", "ready", "failed"]


@dataclass(slots=True)
class Making:
    """How a report that was asked for stands."""

    name: Name
    progress: float = 0.0
    reason: str = ""

    def as_json(self, log: Path) -> dict[str, Any]:
        """With the names of the files there are."""
        return {
            "state": self.name,
            "progress": round(self.progress, 3),
            "reason": self.reason,
            "files": files_of(log),
        }


class ReportMaking:
    """Safe to use from several threads. Its worker starts with the first report asked for.

    Args:
        module: run with the log; it may print its progress, 0 to 1, a line each.
    """

    def __init__(self, module: str = MODULE, seconds: float = SECONDS) -> None:
        self._module, self._seconds = module, seconds
        self._lock = threading.Lock()
        self._asked: dict[str, Making] = {}
        self._waiting: queue.Queue[tuple[Path, Making] | None] = queue.Queue()
        self._worker: threading.Thread | None = None
        self._process: subprocess.Popen[str] | None = None
        self._is_stopped = False

    def ask(self, run_id: str, log: Path) -> Making:
        """Begins to make it, anew if there is one; one that is under way is enough.

        Raises RefusedError while the run is being recorded or too many wait, StorageError.
        """
        try:
            if is_being_written(log):
                raise RefusedError(f"run {run_id} is being recorded; its report comes after")
        except OSError as error:
            raise StorageError(f"cannot read {log}: {error.strerror}") from error
        with self._lock:
            making = self._asked.get(run_id)
            if making is not None and making.name in ("waiting", "working"):
                return making
            if self._waiting.qsize() >= WAITING:
                raise RefusedError(f"{WAITING} reports wait already; try again in some minutes")
            self._asked.pop(run_id, None)
            making = self._asked[run_id] = Making("waiting")
            while len(self._asked) > REMEMBERED:
                self._asked.pop(next(iter(self._asked)))
            self._waiting.put((log, making))
            if self._worker is None and not self._is_stopped:
                self._worker = threading.Thread(target=self._work, name="reports", daemon=True)
                self._worker.start()
            return making

    def state(self, run_id: str) -> Making:
        """Of the newest one asked for; `none` if nobody did since the start."""
        return self._asked.get(run_id) or Making("none")

    def stop(self) -> None:
        """Ends the process that is running, if one is."""
        with self._lock:
            self._is_stopped = True
            if self._process is not None:
                self._process.kill()
        self._waiting.put(None)

    def _work(self) -> None:
        while (job := self._waiting.get()) is not None and not self._is_stopped:
            log, making = job
            try:
                self._make(log, making)
            except Exception as error:  # the others wait for this thread
                making.reason, making.name = f"cannot be made: {error}", "failed"

    def _make(self, log: Path, making: Making) -> None:
        path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]).strip(os.pathsep)
        making.name = "working"
        with self._lock:
            if self._is_stopped:
                return
            self._process = process = subprocess.Popen(
                [sys.executable, "-m", self._module, str(log)],
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                text=True, env={**os.environ, "PYTHONPATH": path},
            )  # fmt: skip
        late = threading.Timer(self._seconds, process.kill)
        late.start()
        said = ""
        assert process.stdout is not None
        for line in process.stdout:
            try:
                making.progress = float(line)
            except ValueError:
                said = line.strip() or said
        status = process.wait()
        is_late = not late.is_alive()
        late.cancel()
        with self._lock:
            self._process = None
        if status == 0:
            making.progress, making.name = 1.0, "ready"
        else:
            slow = f"not done after {self._seconds:.0f} s"
            making.reason = slow if is_late else said[:300] or f"its process ended with {status}"
            making.name = "failed"


def files_of(log: Path) -> list[str]:
    """Names of what lies in the report's folder, documents first."""
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
