"""The run that the recorder makes of an experiment's flight: waits for its start and its file."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Protocol

from console.catalogue.catalogue import Catalogue
from console.runs.recorder import Recorder
from quadrotor.errors import StorageError
from vehicle_link.clock import monotonic

FILE_PATIENCE = 30.0
"""s for the recorder to close the run after touch-down, beyond its set time after disarming."""
BEFORE = 1.0
"""s for the previous run to end, beyond the recorder's set time after disarming."""
LOOK = 0.05
"""s between two checks of the previous run."""


class Settings(Protocol):
    """The station's parameters that concern an experiment."""

    def __call__(self) -> tuple[float, float]:
        """Return the timeout of the sticks, and how long a run continues after disarming, both in
        s.
        """
        ...


def settings_of(parameters: Any) -> Settings:
    """Return the settings of console.parameters.station.StationParameters."""
    return lambda: (float(parameters.sticks.timeout), float(parameters.recorder.after_disarm))


class RunFiles:
    """Waits for the recorder's runs.

    Args:
        after_disarm: returns the seconds that a run continues after disarming.
        cancelled: ends a wait.
    """

    def __init__(
        self,
        recorder: Recorder,
        catalogue: Catalogue,
        after_disarm: Callable[[], float],
        cancelled: threading.Event,
    ) -> None:
        self._recorder, self._catalogue = recorder, catalogue
        self._after_disarm, self._cancelled = after_disarm, cancelled

    def until_free(self) -> Iterator[None]:
        """Yield at each check while the previous run continues; one started by hand is kept."""
        end = monotonic() + self._after_disarm() + BEFORE
        while self._recorder.run_id and monotonic() < end:
            yield

    def closed(self, run_id: str) -> Path:
        """Return the run's file, once the recorder has closed it. Raises StorageError."""
        if not run_id:
            raise StorageError("no run was recorded; see the alarms of the station")
        end = monotonic() + self._after_disarm() + FILE_PATIENCE
        while self._recorder.run_id == run_id or not self._recorder.wait_idle(0.1):
            if self._cancelled.wait(0.1):
                raise StorageError("stopped")
            if monotonic() > end:
                raise StorageError("the run is still being recorded")
        return self._catalogue.resolve(run_id)
