"""A motor on the bench, requested repeatedly for as long as its experiment is alive.

The vehicle stops the motor when the request is not repeated in time; so the end of the experiment
or the station, for any reason, also stops the motor.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from quadrotor.errors import LinkError, QuadlabError, RefusedError
from vehicle_link.clock import monotonic

PERIOD = 0.2
"""s between two requests."""
HANGING_AFTER = 5.0
"""s after which an experiment that does not read its client counts as hanging."""
SHOWN = 0.5
"""s after which the vehicle's status must show the bench."""
BENCH, SILENT = "bench", ""


class LiveBench:
    """The motor bench of one experiment; its thread begins with the first motor.

    Args:
        ask: sends (motor, reference) once. Raises RefusedError, or LinkError without an answer.
        end: requests the end of the bench from the vehicle in any case; does not raise.
        timeout: s after which the vehicle stops the motor.
        mode: returns the vehicle's mode, empty when there is no fresh status.
        last_check: returns when the experiment last read its client, s of the steady clock.

    Attributes:
        problem: why the bench stopped by itself, until it is set again.
    """

    def __init__(
        self,
        ask: Callable[[int, int], None],
        end: Callable[[], None],
        timeout: Callable[[], float],
        mode: Callable[[], str],
        last_check: Callable[[], float],
    ) -> None:
        self._ask, self._request_end = ask, end
        self._timeout, self._mode, self._last_check = timeout, mode, last_check
        self._sending = threading.Lock()
        self._wanted: tuple[int, int] | None = None
        self._since = self._answered_at = 0.0
        self._limit = 0.0
        self._over = threading.Event()
        self._thread: threading.Thread | None = None
        self.problem: QuadlabError | None = None

    @property
    def is_on(self) -> bool:
        return self._wanted is not None

    def set(self, motor: int, reference: int) -> None:
        """Set motor 1 to 4 to a reference (counts), 0 ends it. Raises RefusedError or LinkError."""
        with self._sending:
            if self._over.is_set():
                raise RefusedError("the experiment is over; it can no longer turn a motor")
            self.problem = None
            if not motor:
                self._stop()
                return
            if self._wanted is None:
                self._since, self._limit = monotonic(), self._timeout()
            sent = monotonic()
            try:
                self._ask(motor, reference)
            except QuadlabError:
                self._stop()
                raise
            self._wanted, self._answered_at = (motor, reference), sent
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="bench", daemon=True)
                self._thread.start()

    def give_up(self) -> None:
        """Stop the requests; the motor is stopped in the bench's thread. Does not block."""
        self._over.set()

    def close(self) -> None:
        """Stop the motor, or request it from the vehicle, which also stops it by itself."""
        self._over.set()
        if self._thread is not None:
            self._thread.join(3.0)

    # ------------------------------------------------------------------ its thread
    def _run(self) -> None:
        while not self._over.wait(min(PERIOD, 0.4 * self._limit)):
            with self._sending:
                if self._wanted is not None and not self._over.is_set():
                    self._repeat(*self._wanted)
        with self._sending:
            self._stop()

    def _stop(self) -> None:
        if self._wanted is not None:
            self._wanted = None
            self._request_end()

    def _repeat(self, motor: int, reference: int) -> None:
        try:
            self._check()
            sent = monotonic()
            self._ask(motor, reference)
            self._answered_at = sent
        except LinkError:
            return  # retried in the next period, while the vehicle still turns it
        except QuadlabError as error:
            self.problem = error
            self._stop()

    def _check(self) -> None:
        """Raise RefusedError when it is too late to repeat the request: the vehicle would restart
        a motor that it has stopped.
        """
        now = monotonic()
        if now - self._answered_at > self._limit:
            raise RefusedError(
                f"the vehicle did not answer for {now - self._answered_at:.1f} s and has stopped "
                "the motor on the bench; restore the link and begin again"
            )
        if now - self._since > SHOWN and self._mode() not in (BENCH, SILENT):
            raise RefusedError(f"the vehicle has ended the bench; it is {self._mode()}")
        if now - self._last_check() > HANGING_AFTER:
            raise RefusedError(
                f"the motor was stopped: the experiment did not read its client for "
                f"{HANGING_AFTER:g} s"
            )
