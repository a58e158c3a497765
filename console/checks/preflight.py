"""The pre-flight check list: evaluated continuously, published at 2 Hz, required for arming.

It has its own thread because it reads the state of the disk, which may hang; the heartbeat must
not.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from console.checks.facts import Facts
from console.checks.items import judged, reasons
from console.context import StationContext
from console.link.outbox import WARN
from quadrotor.errors import LinkError, RefusedError
from vehicle_link.checks import Check, to_messages
from vehicle_link.messages import header, new

log = logging.getLogger(__name__)

PERIOD = 0.2
"""Seconds between two evaluations; a change is published at once."""
EVERY = 0.5
ACCEPTED_FOR = 5.0
"""Seconds for which the list of an accepted request to arm belongs to the flight that begins."""


class Preflight:
    """Evaluates and publishes the list, and refuses arming; thread-safe.

    Args:
        facts: returns the present facts; may wait for the disk.
        refresh: reads the vehicle's parameters again when they have changed. Raises LinkError.
    """

    def __init__(
        self, context: StationContext, facts: Callable[[], Facts], refresh: Callable[[], None]
    ) -> None:
        self._outbox, self._link = context.outbox, context.link
        self._limits = context.parameters.preflight
        self._facts, self._refresh = facts, refresh
        self._lock = threading.Lock()
        self._judging = threading.Lock()
        self._accepted: tuple[float, list[Check]] = (float("-inf"), [])
        self._flown: list[Check] | None = None  # the list at arming, while armed
        self._newest: list[Check] = []
        self._published: tuple[object, ...] = ()
        self._published_at = float("-inf")

    def before_arming(self, requester: str) -> None:
        """Raise RefusedError with all the reasons why the vehicle must not be armed now."""
        facts = self._gather()
        if facts.armed or not self._limits.blocks:
            return  # when already armed, the vehicle's own answer is the better one
        checks = judged(facts, self._limits)
        if any(one.name == "parameters" and one.state == "fail" for one in checks):
            checks = judged(self._read_again(), self._limits)
        if failing := reasons(checks):
            line = f"not armed: {'. '.join(failing)}"
            self._outbox.say(WARN, f"refused {requester or 'someone'}: {line}")
            raise RefusedError(line)
        with self._lock:
            self._accepted = (time.monotonic(), checks)

    def tick(self) -> None:
        """Evaluate once; publish when something has changed or a period has passed."""
        facts = self._gather()
        checks = judged(facts, self._limits)
        with self._lock:
            if not facts.armed:
                self._flown, self._newest = None, checks
            elif self._flown is None:
                at, accepted = self._accepted
                self._flown = accepted if time.monotonic() - at < ACCEPTED_FOR else self._newest
            shown = self._newest if self._flown is None else self._flown
        ready = not any(one.state == "fail" for one in shown)
        key = (facts.armed, ready, *((one.name, one.state) for one in shown))
        now = time.monotonic()
        if key == self._published and now - self._published_at < EVERY - PERIOD / 2:
            return
        self._published, self._published_at = key, now
        stamp_ns = self._link.vehicle_ns()
        message = new(
            "quadlab_msgs/Preflight",
            header=header(stamp_ns),
            ready=ready,
            armed=facts.armed,
            blocks=self._limits.blocks,
            checks=to_messages(shown),
        )
        self._outbox.message("preflight", message, stamp_ns)

    def _read_again(self) -> Facts:
        """Read the vehicle's parameters again, as far as it answers, and return the facts."""
        try:
            self._refresh()
        except LinkError:
            log.debug("the vehicle's parameters were not read", exc_info=True)
        return self._gather()

    def _gather(self) -> Facts:
        with self._judging:
            return self._facts()
