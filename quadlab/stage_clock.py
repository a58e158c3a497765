"""Where the processor's time goes in a simulated flight."""

from __future__ import annotations

import time


class StageClock:
    """Seconds by stage; reading it is all it does, so it changes no message."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def restart(self) -> None:
        """The time since the last lap belongs to no stage."""
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Account the time since the last lap or restart to `stage`."""
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now
