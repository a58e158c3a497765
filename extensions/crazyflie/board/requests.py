"""The requests of a dialogue with a Crazyflie, one at a time, each repeated until its answer."""

from __future__ import annotations

import math
from collections.abc import Callable

from extensions.crazyflie.board.messages import Dialogue, Request
from extensions.crazyflie.crtp.packets import Packet

REPEAT_S = 0.1
"""Seconds after which an unanswered request is sent again."""


class Requests:
    """Sends the requests of one dialogue, and passes it their answers.

    Args:
        write: sends a packet.
        now_ns: a clock that measures the round trips.
        note_round_trip: called with the ns from a request that was sent once to its answer.
    """

    def __init__(
        self,
        write: Callable[[Packet], None],
        now_ns: Callable[[], int],
        note_round_trip: Callable[[int], None],
    ) -> None:
        self._write, self._now_ns, self._note_round_trip = write, now_ns, note_round_trip
        self._dialogue: Dialogue | None = None
        self._request: Request | None = None
        self._sent_s, self._sent_ns, self._is_repeated = -math.inf, 0, False

    @property
    def is_open(self) -> bool:
        """Return whether a dialogue has begun and not ended."""
        return self._dialogue is not None

    def begin(self, dialogue: Dialogue, now_s: float) -> None:
        """Send the first request of this dialogue, instead of any other one."""
        self._dialogue = dialogue
        self._send(next(dialogue), now_s)

    def cancel(self) -> None:
        """End the dialogue; an answer that still comes is ignored."""
        self._dialogue = self._request = None

    def is_answered_by(self, packet: Packet) -> bool:
        """Return whether this packet answers the request that was sent last."""
        return self._request is not None and self._request.is_answered_by(packet)

    def advance(self, answer: bytes, now_s: float) -> bool:
        """Continue the dialogue with this answer; return whether that was its end.

        Raises LinkError, from the dialogue, for an answer that it cannot go on with.
        """
        assert self._dialogue is not None
        if not self._is_repeated:
            self._note_round_trip(self._now_ns() - self._sent_ns)
        try:
            self._send(self._dialogue.send(answer), now_s)
        except StopIteration:
            self.cancel()
            return True
        return False

    def repeat(self, now_s: float) -> None:
        """Send the request again if its answer is overdue."""
        if self._request is not None and now_s - self._sent_s > REPEAT_S:
            self._send(self._request, now_s, is_repeated=True)

    def _send(self, request: Request, now_s: float, *, is_repeated: bool = False) -> None:
        self._request = request
        self._sent_s, self._sent_ns, self._is_repeated = now_s, self._now_ns(), is_repeated
        self._write(request.packet)
