"""The guided calibration of a camera's intrinsics on the Settings page.

One runs at a time, for all vehicles and pages: it opens a camera of this computer in a process of
its own (`extensions.vision.calibration.guided`), which a person at any page may finish or cancel.
Every page that shows it follows it over `/camera`. An accepted result is stored where
`quadlab tracker` looks for it; until then nothing changes.
"""

from __future__ import annotations

import asyncio
import base64
import threading
from dataclasses import asdict
from typing import Any, Literal

from fastapi import WebSocket

from extensions.vision.calibration.guided import calibrate_guided
from extensions.vision.tags.camera_calibration import FEWEST_VIEWS, CameraCalibration
from extensions.vision.tags.charuco import Board
from extensions.vision.tracker.camera_store import CameraStore
from quadrotor.errors import QuadlabError, RefusedError
from vehicle_link.jobs import POLL, Job
from web.live.conversation import send_json

PACE = 0.08
"""Seconds between two pictures of the simulated camera."""
FINISH_TIME = 20.0
"""Seconds after which a job that was asked to finish is ended."""

State = Literal["none", "running", "ready", "failed"]


class CameraCalibrations:
    """The newest guided calibration of a camera; thread-safe.

    Args:
        store: of the intrinsics.
        pace: s between two pictures of the simulated camera.
    """

    def __init__(self, store: CameraStore, pace: float = PACE) -> None:
        self.store, self.pace = store, pace
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._is_cancelled = self._is_finishing = False
        self._state: State = "none"
        self._camera: int | str = ""
        self._requester = self._reason = self._decision = self._file = ""
        self._progress: dict[str, Any] = {}
        self._found: CameraCalibration | None = None
        self._picture = b""
        self._pages: dict[asyncio.Event, asyncio.AbstractEventLoop] = {}

    # ------------------------------------------------------------------ what people do
    def begin(self, camera: int | str, board: Board, requester: str) -> None:
        """Start a calibration; what was found before is dropped. Raises RefusedError while one
        runs, or another person's waits for a decision.
        """
        with self._lock:
            if self._thread is not None:
                raise RefusedError(
                    f"{self._requester} is calibrating {_called(self._camera)}; wait until that "
                    "has ended, or cancel it"
                )
            waits = self._state == "ready" and not self._decision
            if waits and requester != self._requester:
                raise RefusedError(
                    f"the result of {self._requester} for {_called(self._camera)} must be "
                    "accepted or cancelled first"
                )
            self._camera, self._requester, self._state = camera, requester, "running"
            self._reason = self._decision = self._file = ""
            self._progress, self._found, self._picture = {}, None, b""
            self._is_cancelled = self._is_finishing = False
            self._thread = threading.Thread(
                target=self._run, args=(board,), name="camera calibration", daemon=True
            )
            self._thread.start()
        self._wake()

    def finish(self) -> None:
        """End with the views taken so far. Raises RefusedError when they are too few."""
        with self._lock:
            self._check_running()
            views = self._progress.get("views", 0)
            if views < FEWEST_VIEWS:
                raise RefusedError(
                    f"the board was taken in {views} pictures, {FEWEST_VIEWS} are needed: hold it "
                    "still in more places, or cancel"
                )
            self._is_finishing = True

    def cancel(self) -> None:
        """End without a result, or drop the result; nothing changes. Raises RefusedError when there
        is nothing to cancel.
        """
        with self._lock:
            if self._state == "ready" and not self._decision:
                self._decision = "rejected"
            else:
                self._check_running()
                self._is_cancelled = True
        self._wake()

    def accept(self, requester: str) -> None:
        """Store the result. Raises RefusedError without one, StorageError."""
        with self._lock:
            if self._found is None or self._decision:
                raise RefusedError("there is no result to accept: calibrate a camera first")
            self._file = str(self.store.keep(self._camera, self._found, requester))
            self._decision = "accepted"
        self._wake()

    def stop(self) -> None:
        """End the job, if any, and wait for it."""
        with self._lock:
            self._is_cancelled, thread = True, self._thread
        if thread is not None:
            thread.join()

    # ------------------------------------------------------------------ what pages show
    def as_json(self) -> dict[str, Any]:
        """Return the state for the page: pixels; corners with the model's distance from each."""
        with self._lock:
            found = self._found
            result = None
            if found is not None:
                result = {
                    **asdict(found),
                    "corners": [[round(one, 2) for one in corner] for corner in found.corners],
                    "warnings": list(found.warnings),
                    "focal_lengths": found.focal_lengths,
                }
            return {
                "state": self._state,
                "camera": self._camera,
                "requester": self._requester,
                "reason": self._reason,
                "decision": self._decision,
                "file": self._file,
                "progress": self._progress,
                "result": result,
            }

    async def talk(self, socket: WebSocket) -> None:
        """Send the state and the newest picture whenever either changes."""
        news, shown = asyncio.Event(), b""
        news.set()
        self._pages[news] = asyncio.get_running_loop()
        try:
            while True:
                await news.wait()
                news.clear()
                await send_json(socket, self.as_json())
                picture = self._picture
                if picture and picture is not shown:
                    shown = picture
                    await socket.send_bytes(picture)
        finally:
            del self._pages[news]

    def _wake(self) -> None:
        for news, loop in tuple(self._pages.items()):
            loop.call_soon_threadsafe(news.set)

    # ------------------------------------------------------------------ the job's thread
    def _run(self, board: Board) -> None:
        found, reason = None, ""
        try:
            found = self._calibrated(board)
        except QuadlabError as error:
            reason = str(error)
        except Exception as error:  # pages must not show a calibration that runs no more
            reason = f"the calibration failed: {error}"
        with self._lock:
            self._thread = None
            if self._is_cancelled:
                self._state = "none"
            else:
                self._state = "ready" if found else "failed"
                self._found, self._reason = found, reason
        self._wake()

    def _calibrated(self, board: Board) -> CameraCalibration | None:
        """Return the result of the job; None when it was cancelled. Raises as the job does."""
        job = Job(calibrate_guided, self._camera, board, self.pace, niceness=0, report=self._take)
        try:
            left = FINISH_TIME
            while not job.poll(POLL):
                if self._is_cancelled:
                    return None
                if self._is_finishing:
                    if left == FINISH_TIME:
                        job.terminate()
                    left -= POLL
                    if left < 0.0:
                        raise RefusedError("the camera's process does not finish; calibrate again")
            return job.result()
        finally:
            job.stop()

    def _take(self, report: dict[str, Any]) -> None:
        with self._lock:
            self._picture = base64.b64decode(report.pop("picture"))
            self._progress = report
        self._wake()

    def _check_running(self) -> None:
        if self._thread is None:
            raise RefusedError("no camera is being calibrated")


def _called(camera: int | str) -> str:
    return f"camera {camera}" if isinstance(camera, int) else "the simulated camera"
