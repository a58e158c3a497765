"""The run that the recorder makes of an experiment's flight: waits for its start and its file."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

from console.catalogue.catalogue import Catalogue
from console.parameters.station import StationParameters
from console.runs.recorder import Recorder
from quadrotor.errors import StorageError
from vehicle_link.clock import monotonic

FILE_PATIENCE = 30.0
"""s for the recorder to close the run after touch-down, beyond its set time after disarming."""
BEFORE = 1.0
"""s for the previous run to end, beyond the recorder's set time after disarming."""
LOOK = 0.05
"""s between two checks of the previous run."""


class RunFiles:
    """Waits for the recorder's runs.

    Args:
        parameters: of the station, read at each wait.
        cancelled: ends a wait.
    """

    def __init__(
        self,
        recorder: Recorder,
        catalogue: Catalogue,
        parameters: StationParameters,
        cancelled: threading.Event,
    ) -> None:
        self._recorder, self._catalogue = recorder, catalogue
        self._parameters, self._cancelled = parameters, cancelled

    def until_free(self) -> Iterator[None]:
        """Yield at each check while the previous run continues; one started by hand is kept."""
        end = monotonic() + self._parameters.recorder.after_disarm + BEFORE
        while self._recorder.run_id and monotonic() < end:
            yield

    def closed(self, run_id: str) -> Path:
        """Return the run's file, once the recorder has closed it. Raises StorageError."""
        if not run_id:
            raise StorageError("no run was recorded; see the alarms of the station")
        end = monotonic() + self._parameters.recorder.after_disarm + FILE_PATIENCE
        while self._recorder.run_id == run_id or not self._recorder.wait_idle(0.1):
            if self._cancelled.wait(0.1):
                raise StorageError("stopped")
            if monotonic() > end:
                raise StorageError("the run is still being recorded")
        return self._catalogue.resolve(run_id)
