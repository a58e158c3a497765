"""The thread that reads a source, and opens it again after errors that may pass."""

from __future__ import annotations

import threading
from collections.abc import Callable

from console.trackers.source import Frame, Source
from quadrotor.errors import MeasurementError, QuadlabError, UsageError

RETRY = 1.0
"""Seconds between two tries to open the source."""


class SourceReader:
    """Reader of a source until `close`, or until an error that another try would not mend.

    Args:
        put: called in the reader's thread with each frame and each error.
    """

    def __init__(
        self, name: str, open_source: Callable[[], Source], put: Callable[[Frame | Exception], None]
    ) -> None:
        self._open_source, self._put = open_source, put
        self._source: Source | None = None
        self._closed = threading.Event()
        self.thread = threading.Thread(target=self._run, name=name, daemon=True)
        self.thread.start()

    def close(self) -> None:
        """Close the source; the thread ends soon after."""
        self._closed.set()
        if self._source is not None:
            self._source.close()

    def _run(self) -> None:
        while not self._closed.is_set():
            source = None
            try:
                source = self._source = self._open_source()
                self._read(source)
            except Exception as error:  # for the thread that handles the frames
                self._put(error)
                if is_final(error):
                    return
            finally:
                if source is not None:
                    source.close()
            self._closed.wait(RETRY)

    def _read(self, source: Source) -> None:
        while not self._closed.is_set():
            try:
                for frame in source.frames():
                    self._put(frame)
                return
            except MeasurementError as error:  # in one frame: the next may be usable
                self._put(error)


def is_final(error: Exception) -> bool:
    """Return whether another try in this process would not help."""
    return isinstance(error, UsageError) or not isinstance(error, QuadlabError)
