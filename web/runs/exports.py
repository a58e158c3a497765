"""Recordings for viser, made one at a time in a process of their own and kept beside the run."""

from __future__ import annotations

import os
import queue
import subprocess
import sys
import threading
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

from quadrotor.errors import RefusedError, StorageError
from vehicle_link.log.file import is_being_written

MODULE = "web.runs.viser_recording"
ROOT = Path(__file__).parents[2]
WAITING = 20
"""Recordings that may wait for their turn."""
REMEMBERED = 200

Name = Literal["waiting", "working", "ready", "failed"]


@dataclass(slots=True)
class Export:
    """How a recording stands; `path` when it is ready."""

    name: Name
    progress: float = 0.0
    reason: str = ""
    path: Path | None = None

    def as_json(self) -> dict[str, Any]:
        return {"state": self.name, "progress": round(self.progress, 3), "reason": self.reason}


class ViserExports:
    """Safe to use from several threads. Its worker starts with the first recording asked for.

    Args:
        module: run with the log and the file to write.
    """

    def __init__(self, module: str = MODULE) -> None:
        self._module = module
        self._version = version("viser")  # a recording is of the client that plays it
        self._lock = threading.Lock()
        self._exports: dict[tuple[str, int], Export] = {}  # by run and age of its log
        self._waiting: queue.Queue[tuple[Path, Path, Export] | None] = queue.Queue()
        self._worker: threading.Thread | None = None
        self._process: subprocess.Popen[str] | None = None
        self._is_stopped = False

    def ask(self, run_id: str, log: Path) -> Export:
        """Begins to make it, unless it is there, under way or has failed before.

        Raises RefusedError while the run is being recorded or too many wait, StorageError.
        """
        file = log.with_name(f"{log.stem}.{self._version}.viser")
        try:
            written_ns = log.stat().st_mtime_ns
            if is_being_written(log):
                raise RefusedError(f"run {run_id} is being recorded; its 3D recording comes after")
        except OSError as error:
            raise StorageError(f"cannot read {log}: {error.strerror}") from error
        with self._lock:
            if file.exists() and file.stat().st_mtime_ns >= written_ns:
                return Export("ready", 1.0, path=file)
            key = (run_id, written_ns)
            export = self._exports.get(key)
            if export is not None and export.name != "ready":
                return export
            if self._waiting.qsize() >= WAITING:
                raise RefusedError(f"{WAITING} recordings wait already; try again in some minutes")
            export = self._exports[key] = Export("waiting")
            while len(self._exports) > REMEMBERED:
                self._exports.pop(next(iter(self._exports)))
            self._waiting.put((log, file, export))
            if self._worker is None and not self._is_stopped:
                self._worker = threading.Thread(target=self._work, name="exports", daemon=True)
                self._worker.start()
            return export

    def stop(self) -> None:
        """Ends the process that is running, if one is; nothing half stays."""
        with self._lock:
            self._is_stopped = True
            if self._process is not None:
                self._process.kill()
        self._waiting.put(None)

    def _work(self) -> None:
        while (job := self._waiting.get()) is not None and not self._is_stopped:
            log, file, export = job
            try:
                self._make(log, file, export)
            except Exception as error:  # the others wait for this thread
                export.reason, export.name = f"cannot be made: {error}", "failed"

    def _make(self, log: Path, file: Path, export: Export) -> None:
        path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]).strip(os.pathsep)
        export.name = "working"
        with self._lock:
            if self._is_stopped:
                return
            self._process = process = subprocess.Popen(
                [sys.executable, "-m", self._module, str(log), str(file)],
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                text=True, env={**os.environ, "PYTHONPATH": path},
            )  # fmt: skip
        said = ""
        assert process.stdout is not None
        for line in process.stdout:
            try:
                export.progress = float(line)
            except ValueError:
                said = line.strip() or said
        status = process.wait()
        with self._lock:
            self._process = None
        if not log.exists():  # deleted meanwhile
            file.unlink(missing_ok=True)
            export.reason, export.name = "the run was deleted meanwhile", "failed"
        elif status == 0 and file.exists():
            export.path, export.progress, export.name = file, 1.0, "ready"
        else:
            file.with_name(f"{file.name}.new").unlink(missing_ok=True)
            export.reason = said[:300] or f"its process ended with status {status}"
            export.name = "failed"
