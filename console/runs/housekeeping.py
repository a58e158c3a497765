"""Background tasks: old files are tidied, the trash is emptied, a full disk is reported early."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from console.catalogue.catalogue import Catalogue
from console.parameters.station import RecorderParameters
from console.runs.adoption import tidy_runs
from console.runs.disk import size_text
from console.runs.run import RecorderStatus
from console.runs.storage import storage
from console.runs.trash import purge
from quadrotor.errors import StorageError

PERIOD = 5.0
"""Seconds between checks of the disk."""
PURGE_PERIOD, RETRY = 3600.0, 60.0
"""Seconds between checks of the trash: normally, and while something in it cannot be removed."""
DAY = 86_400.0


class Housekeeping:
    """The housekeeping of runs and disk.

    Args:
        recording: returns the recorder's present status.
        say: publishes an event line.
        alarm: sets (key, line) or clears (key, None) an alarm.
        purges: whether to tidy and to purge the trash, which one of several stations does.
    """

    def __init__(
        self,
        catalogue: Catalogue,
        parameters: RecorderParameters,
        recording: Callable[[], RecorderStatus],
        say: Callable[[str], None],
        alarm: Callable[[str, str | None], None],
        *,
        purges: bool = True,
    ) -> None:
        self._catalogue = catalogue
        self._parameters = parameters
        self._recording = recording
        self._say = say
        self._alarm = alarm
        self._purges = purges
        self._purged = -PURGE_PERIOD
        self._purge_problem: str | None = None

    def begin(self, _: threading.Event, guard: Callable[[Callable[[], None]], None]) -> None:
        """Tidy once if this station purges."""
        if self._purges:
            guard(self.tidy)

    def tidy(self) -> None:
        """Tidy once, in the background: a present flight must not wait for old files."""
        try:
            for line in tidy_runs(self._catalogue, skip=(self._recording().run_id,)):
                self._say(line)
        except StorageError as error:
            self._alarm("catalogue", str(error))

    def check(self) -> None:
        """Check disk and trash."""
        try:
            self._alarm("disk", self._warning())
            due = time.monotonic() - self._purged >= (
                RETRY if self._purge_problem else PURGE_PERIOD
            )
            if self._purges and due:
                self._purged = time.monotonic()
                self._purge_problem = self._purge()
            self._alarm("trash", self._purge_problem)
        except StorageError as error:
            # Without the folder nothing is done here, and the recorder reports that it is missing.
            away = self._catalogue.problem or not self._catalogue.folder.is_dir()
            self._alarm("trash", None if away else str(error))

    def _purge(self) -> str | None:
        """Purge the trash; return what could not be removed, in one line, or None."""
        days = self._parameters.trash_keep
        purged = purge(self._catalogue, days * DAY)
        for run_id in purged.done:
            self._say(f"run {run_id}: removed for good, {days:g} days after it was deleted")
        return "; ".join(purged.refused.values()) or None

    def _warning(self) -> str | None:
        disk = storage(self._catalogue)
        if disk.free >= self._parameters.warn_free * 1e6:
            return None
        status = self._recording()
        rate = status.bytes / status.duration if status.duration > 1.0 else 0.0
        left = disk.lasts(round(self._parameters.keep_free * 1e6), rate)
        lasts = "" if left is None else f", recording lasts {left / 60.0:.0f} min more"
        return f"disk: {size_text(disk.free)} free{lasts}; delete runs and empty the trash"
