"""The sticks at the station: whose they are, the watchdog's clock, and an answer to each message.

Each message of `stick` is answered on `stick_status` with its own stamp, so that a page can measure
how long its sticks take to arrive here and whether they are forwarded to the vehicle. Silence is
noticed by a thread that sleeps until it is due: a loop at 20 Hz would add up to 50 ms.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from console.commands.stick_watchdog import StickOrder, StickWatchdog
from console.link.outbox import Outbox
from vehicle_link.clock import monotonic
from vehicle_link.messages import Message, decode, encode, header, new
from vehicle_link.topics.control_inputs import Sticks, decode_joy
from vehicle_link.transport.publisher import Received

log = logging.getLogger(__name__)

REPEAT = 0.05  # s between two messages of one drop
EARLY = 0.01  # s, so that the drop is sent, and not only due, when the silence has lasted
REFUSED_MOST = 100
JOY, STATUS = "sensor_msgs/Joy", "quadlab_msgs/StickStatus"


class StickHandler:
    """Handles the stick messages of one vehicle; thread-safe.

    Args:
        accepts: (requester, whether their dead-man is held) → whether their sticks count.
        passes: returns whether an order is sent; while an experiment flies, only sticks that take
            over are.
        timeout: returns the seconds of silence after which sticks are dropped.
    """

    def __init__(
        self,
        outbox: Outbox,
        accepts: Callable[[str, bool], bool],
        passes: Callable[[StickOrder], bool],
        timeout: Callable[[], float],
    ) -> None:
        self._outbox, self._accepts, self._passes = outbox, accepts, passes
        self._timeout = timeout
        self._watchdog = StickWatchdog()
        self._changed = threading.Condition()
        self._last = Sticks(0, (0.0, 0.0, 0.0, 0.0), enabled=False)
        self._refused: set[str] = set()
        """Requesters whose held sticks were refused: they must release the button first."""
        self._closing = False
        # Serialisers are generated on first use, which takes up to 0.1 s.
        decode(encode(new(JOY)), JOY)
        encode(new(STATUS))
        self._thread = threading.Thread(target=self._watch, name="sticks", daemon=True)
        self._thread.start()

    def close(self) -> None:
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join(1.0)

    @property
    def alarm(self) -> str | None:
        """Return what is wrong with the sticks, until their button is released."""
        with self._changed:
            if not self._watchdog.dropped:
                return None
            whose = f" of {self._last.requester}" if self._last.requester else ""
        return (
            f"sticks{whose} dropped: silent for {self._timeout():g} s; "
            "release the dead-man button and press it again"
        )

    def received(self, message: Received) -> None:
        """Handle one message of `stick`. Raises LinkError or MeasurementError when it
        is invalid.
        """
        timeout = self._timeout()
        if message.received_ns - message.source_ns > timeout * 1e9:
            return  # from a process that was stopped; the watchdog has noticed
        sticks = decode_joy(message.payload)
        if sticks.enabled and sticks.requester in self._refused:
            self._answer(sticks, False, "release the dead-man button and press it again")
            return
        self._refused.discard(sticks.requester)
        if not self._accepts(sticks.requester, sticks.enabled):
            if sticks.enabled and len(self._refused) < REFUSED_MOST:
                self._refused.add(sticks.requester)
            # What these sticks held is dropped by their silence, or at once when they let go.
            if not sticks.enabled:
                self._let_go(sticks, timeout)
            self._answer(sticks, False, "someone else has control" if sticks.enabled else "")
            return
        with self._changed:
            order = self._watchdog.feed(sticks.axes, sticks.enabled, monotonic(), timeout)
            dropped, self._last = self._watchdog.dropped, sticks
            self._changed.notify()
        passes = self._passes(order)
        if passes:
            self._outbox.joy(order.axes, order.enabled)
        reason = ""
        if sticks.enabled and dropped:
            reason = "dropped by the station's watchdog"
        elif sticks.enabled and not passes:
            reason = "an experiment is flying; deflect a stick to take over"
        self._answer(sticks, order.enabled, reason)

    def _let_go(self, sticks: Sticks, timeout: float) -> None:
        """Release the sticks of a person who lost control; otherwise their drop would stay for
        ever.
        """
        with self._changed:
            if self._last.requester == sticks.requester:
                self._watchdog.feed(sticks.axes, False, monotonic(), timeout)
                self._changed.notify()

    def _watch(self) -> None:
        while not self._closing:
            try:
                self._watch_once()
            except Exception:  # a defect in one drop must not end the watch over the next
                log.exception("sticks")

    def _watch_once(self) -> None:
        with self._changed:
            if self._closing:
                return
            now, timeout = monotonic() + EARLY, self._timeout()
            order = self._watchdog.tick(now, timeout)
            last, is_drop = self._last, self._watchdog.dropped
            if order is None:
                self._changed.wait(self._watchdog.due(now, timeout))
                return
        if self._passes(order):
            self._outbox.joy(order.axes, order.enabled)
        if is_drop:
            self._answer(last, False, f"silent for {timeout:g} s")
        with self._changed:
            self._changed.wait(REPEAT)

    def _answer(self, sticks: Sticks, enabled: bool, reason: str) -> None:
        stamp_ns = sticks.stamp_ns
        answer: Message = new(
            STATUS, header=header(stamp_ns, sticks.requester), enabled=enabled, reason=reason
        )
        self._outbox.message("stick_status", answer, stamp_ns)
