"""Publishes the experiment's state: on change, and often while one runs."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from console.evaluation.result import PASSED
from console.experiment_running import state as phases
from console.experiment_running.state import ExperimentState, plain
from console.experiments.readings import Progress
from console.link.outbox import INFO, WARN, Outbox
from quadrotor.errors import LinkError
from vehicle_link.clock import monotonic

log = logging.getLogger(__name__)

OFTEN, SELDOM = 4, 20
"""Cycles (50 ms) between two statuses, while an experiment runs and otherwise."""
SOON = 0.2
"""s, least time between two statuses sent for new instructions."""


class ExperimentStatusPublisher:
    """Publishes `experiment_status`; any thread may write, under `lock`.

    Args:
        vehicle_ns: returns the time of the vehicle's clock.
        manual: returns whether a person flies with the sticks.
    """

    def __init__(
        self, outbox: Outbox, vehicle_ns: Callable[[], int], manual: Callable[[], bool]
    ) -> None:
        self._outbox, self._vehicle_ns, self._manual = outbox, vehicle_ns, manual
        self.lock = threading.RLock()
        self._sending = threading.Lock()
        self._sent = 0.0
        self.state = ExperimentState()

    def say(self, level: int, line: str) -> None:
        self._outbox.say(level, line)

    def set(self, **fields: object) -> None:
        """Set fields of the state, and publish it when they have changed."""
        with self.lock:
            changed = any(getattr(self.state, name) != value for name, value in fields.items())
            for name, value in fields.items():
                setattr(self.state, name, value)
        if changed:
            self.send()

    def tell(self, progress: Progress) -> None:
        """Publish progress: a new instruction at once, its figures with the next status.

        Raises TypeError or ValueError for values that a message cannot carry.
        """
        new = plain(progress)
        with self.lock:
            before, self.state.progress = self.state.progress, new
            is_late = monotonic() - self._sent > SOON
        if is_late and (new.instruction, new.number) != (before.instruction, before.number):
            self.send()

    def end(self, phase: str, reason: str) -> None:
        """Set the final state, log and publish it."""
        with self.lock:
            state = self.state
            state.phase, state.reason, state.step = phase, reason, ""
            state.progress, state.question = phases.NO_PROGRESS, ""
            state.ended = monotonic()
            name = state.name
        level = INFO if phase == PASSED else WARN
        words = phase.replace("_", " ")
        self.say(level, f"experiment {name}: {words}{': ' if reason else ''}{reason}")
        self.send()

    def tick(self, count: int) -> None:
        """Publish in each cycle of the station, less often while no experiment runs."""
        if count % (OFTEN if self.state.running else SELDOM) == 0:
            self.send()

    def send(self) -> None:
        stamp_ns = self._vehicle_ns()
        with self._sending:  # keeps the statuses in order
            with self.lock:
                message = self.state.message(stamp_ns, self._manual())
                self._sent = monotonic()
            try:
                self._outbox.message("experiment_status", message, stamp_ns)
            except LinkError:
                log.debug("the session is closed", exc_info=True)
