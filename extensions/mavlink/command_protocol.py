"""Commands and their acknowledgements: each is done once, however often it is sent."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from extensions.mavlink.commands import Wanted, wanted_of
from extensions.mavlink.dialect import MAVLink_message, mavlink
from extensions.mavlink.frames import Origin
from extensions.mavlink.operators import UNANSWERED
from extensions.mavlink.peer import Peer
from quadrotor.errors import RefusedError

REPEATED = 1.0
"""Seconds in which the same command again is a repetition: it gets the same answer."""
ANSWERS_MOST = 100

Answered = Callable[[str], None]
"""Called with the reason of a refusal, or ""."""


@dataclass
class Answer:
    """The answer to a command; its result is None while it is awaited."""

    sent: bytes
    result: int | None
    at: float


class CommandProtocol:
    """The commands of all ground stations.

    Args:
        do: does what is wanted and calls the last argument at once or later; returns whether it is
            known. Raises RefusedError.
        say: tells a ground station a line, and prints it.
    """

    def __init__(
        self,
        origin: Origin,
        do: Callable[[Peer, Wanted, Answered], bool],
        say: Callable[[Peer, str], None],
    ) -> None:
        self._origin, self._do, self._say = origin, do, say
        self._answers: dict[tuple[str, int], Answer] = {}

    def take(self, peer: Peer, message: MAVLink_message) -> None:
        """Do a COMMAND_LONG or COMMAND_INT, and answer it; answer a repetition alone."""
        command, sent = message.command, bytes(message.get_payload())
        known, now = self._answers.get((peer.name, command)), time.monotonic()
        if known is not None and (
            known.result is None or (known.sent == sent and now - known.at < REPEATED)
        ):
            self._acknowledge(peer, command, known.result)
            return
        if len(self._answers) > ANSWERS_MOST:
            awaited = {key: one for key, one in self._answers.items() if one.result is None}
            self._answers = awaited
        answer = self._answers[peer.name, command] = Answer(sent, None, now)

        def finish(result: int, reason: str = "") -> None:
            answer.result, answer.at = result, time.monotonic()
            self._acknowledge(peer, command, result)
            if reason:
                self._say(peer, reason)

        def answered(reason: str) -> None:
            failed = reason.startswith(UNANSWERED)
            bad = mavlink.MAV_RESULT_FAILED if failed else mavlink.MAV_RESULT_DENIED
            finish(bad if reason else mavlink.MAV_RESULT_ACCEPTED, reason)

        try:
            wanted = wanted_of(message, self._origin)
            if wanted is None or not self._do(peer, wanted, answered):
                finish(mavlink.MAV_RESULT_UNSUPPORTED)
        except RefusedError as error:
            answered(str(error))
        if answer.result is None:
            self._acknowledge(peer, command, None)

    def left(self, peer: Peer) -> None:
        """Forget a ground station."""
        self._answers = {key: one for key, one in self._answers.items() if key[0] != peer.name}

    def _acknowledge(self, peer: Peer, command: int, result: int | None) -> None:
        shown = mavlink.MAV_RESULT_IN_PROGRESS if result is None else result
        peer.send(mavlink.MAVLink_command_ack_message(command, shown, 255, 0, peer.system, 0))
