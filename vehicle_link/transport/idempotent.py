"""Handlers of services: a refusal is an answer, and a repeated request has no second effect.

A caller that lost the answer sends the same request id again within 5 s, and gets the answer to
the first one.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING, Generic, TypeVar, cast

from quadrotor.errors import NoAnswerError, QuadlabError, RefusedError
from vehicle_link.messages import Message, decode, encode, new, stored_name, typestore

if TYPE_CHECKING:
    from vehicle_link.messages.records import CommandRequest

A = TypeVar("A", bound=Message)
Q = TypeVar("Q", bound=Message)
KEEP = 5.0
"""Seconds for which an answer is remembered."""


def answering(srv_type: str, handler: Callable[[Q], A]) -> Callable[[Message], A]:
    """Return a handler whose refusals are answers, if the service's response has `accepted`."""
    answer = f"{srv_type}_Response"

    def handle(request: Message) -> A:
        try:
            return handler(cast("Q", request))
        except NoAnswerError:
            raise
        except QuadlabError as error:
            known = dict(typestore().fielddefs[stored_name(answer)][1])
            if "accepted" not in known:
                raise
            more = {"kind": error.kind} if isinstance(error, RefusedError) else {}
            more = {name: value for name, value in more.items() if name in known}
            return cast("A", new(answer, accepted=False, reason=str(error), **more))

    return handle


def prepare(srv_type: str) -> None:
    """Make the serialisers now: rosbags generates them on first use, which takes up to 0.1 s."""
    encode(new(f"{srv_type}_Response"))
    decode(encode(new(f"{srv_type}_Request")), f"{srv_type}_Request")


class Idempotent(Generic[A]):
    """Wrapper of the handler of a service whose requests have a `request_id`.

    A repeated id waits while the first request is still being handled. A request with an empty id
    is always handled. An exception from the handler is remembered like an answer.
    """

    def __init__(
        self, handler: Callable[[Q], A], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._handler = cast("Callable[[Message], A]", handler)
        self._clock = clock
        self._lock = threading.Lock()
        self._answers: dict[str, tuple[float, Future[A]]] = {}

    def __call__(self, request: Message) -> A:
        request_id = str(cast("CommandRequest", request).request_id)
        if not request_id:
            return self._handler(request)
        answer, is_new = self._answer_of(request_id)
        if is_new:
            try:
                answer.set_result(self._handler(request))
            except BaseException as error:
                answer.set_exception(error)
        return answer.result()

    def _answer_of(self, request_id: str) -> tuple[Future[A], bool]:
        now = self._clock()
        with self._lock:
            while self._answers:  # oldest first
                oldest, (since, _) = next(iter(self._answers.items()))
                if now - since < KEEP:
                    break
                del self._answers[oldest]
            if request_id in self._answers:
                return self._answers[request_id][1], False
            answer: Future[A] = Future()
            self._answers[request_id] = (now, answer)
            return answer, True
