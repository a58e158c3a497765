"""Those who command over MAVLink: each ground station is a requester of its own at the station.

The station's lease decides between them and the people at the page (docs/access.md). A request may
wait for the vehicle for seconds, so each requester has a thread for its commands, and another one
for emergencies.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

from quadrotor.errors import NoAnswerError, QuadlabError

if TYPE_CHECKING:
    from quadlab.station_client import StationClient

WAITING_MOST = 8
"""Most requests of one ground station that wait at a time."""
UNANSWERED = "no answer: "
"""Begins the reason of a command whose outcome is unknown."""
EMERGENCY_TRIES = 5
"""Number of times that an emergency is sent while nobody answers."""

Then = Callable[[Any, str], None]
"""Called in the gateway's thread with the answer and "", or with None and the reason."""
Connect = Callable[[str], "StationClient"]
"""Returns a client of the station in this name; raises LinkError."""


class Operator:
    """One requester. Its work is done in a thread; each result is put into `results` as a call for
    the gateway's thread.
    """

    def __init__(
        self, name: str, connect: Connect, results: queue.SimpleQueue[Callable[[], None]]
    ) -> None:
        self._name, self._connect, self._results = name, connect, results
        self._client: StationClient | None = None
        self._connecting = threading.Lock()
        self._pools = {urgent: ThreadPoolExecutor(1) for urgent in (False, True)}
        self._waiting = 0

    def ask(self, then: Then, service: str, **fields: Any) -> None:
        """Ask the station for a command; `then` gets its answer."""
        if service != "emergency":
            self.start(then, lambda client: client.ask(service, **fields))
            return

        def repeated(client: StationClient) -> object:
            for _ in range(EMERGENCY_TRIES - 1):
                try:
                    return client.ask(service, **fields)
                except NoAnswerError:
                    continue  # the last try tells
            return client.ask(service, **fields)

        self.start(then, repeated, urgent=True)

    def start(
        self, then: Then, work: Callable[[StationClient], Any], *, urgent: bool = False
    ) -> None:
        """Do work with the client in a thread; urgent work waits for no other."""
        if self._waiting >= WAITING_MOST and not urgent:
            then(None, f"{WAITING_MOST} commands of {self._name} wait already; wait for an answer")
            return
        self._waiting += 1

        def run() -> None:
            answer, reason = None, ""
            try:
                with self._connecting:
                    self._client = self._client or self._connect(self._name)
                answer = work(self._client)
            except NoAnswerError as error:
                reason = f"{UNANSWERED}{error}"
            except QuadlabError as error:
                reason = str(error)
            self._results.put(lambda: self._give(then, answer, reason))

        self._pools[urgent].submit(run).add_done_callback(self._raise_here)

    def _raise_here(self, done: Any) -> None:
        """Let an error of the program itself end the gateway."""
        if done.exception() is not None:
            self._results.put(done.result)

    def _give(self, then: Then, answer: object, reason: str) -> None:
        self._waiting -= 1
        then(answer, reason)

    def close(self) -> None:
        """Give up control, in the background."""

        def end() -> None:
            if self._client is not None:
                self._client.close()

        self._pools[False].submit(end)
        for pool in self._pools.values():
            pool.shutdown(wait=False)
