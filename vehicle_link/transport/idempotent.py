"""A repeated request gets the first one's answer and has no second effect.

A caller whose answer was lost sends the same request id again within 5 s.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future

from vehicle_link.messages import Message

KEEP = 5.0
"""s for which an answer is remembered."""


class Idempotent:
    """Wraps the handler of a service whose requests have a `request_id`.

    The same id while the first is still being handled waits for it. An empty id is always
    handled. What the handler raises is remembered like an answer.
    """

    def __init__(
        self,
        handler: Callable[[Message], Message],
        keep: float = KEEP,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._handler = handler
        self._keep = keep
        self._clock = clock
        self._lock = threading.Lock()
        self._answers: dict[str, tuple[float, Future[Message]]] = {}

    def __call__(self, request: Message) -> Message:
        if not request.request_id:
            return self._handler(request)
        answer, is_new = self._answer_of(str(request.request_id))
        if is_new:
            try:
                answer.set_result(self._handler(request))
            except BaseException as error:
                answer.set_exception(error)
        return answer.result()

    def _answer_of(self, request_id: str) -> tuple[Future[Message], bool]:
        now = self._clock()
        with self._lock:
            while self._answers:  # oldest first
                oldest, (since, _) = next(iter(self._answers.items()))
                if now - since < self._keep:
                    break
                del self._answers[oldest]
            if request_id in self._answers:
                return self._answers[request_id][1], False
            answer: Future[Message] = Future()
            self._answers[request_id] = (now, answer)
            return answer, True
