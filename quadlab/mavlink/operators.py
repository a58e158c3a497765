"""Those who command over MAVLink: each ground station is a requester of its own at the station.

The station's lease decides between them and the people at the page (docs/access.md). A request may
wait for the vehicle for seconds, so each requester has a thread of its own for its commands, and
emergencies have another.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, Protocol

from quadlab.mavlink.link import MOST
from quadrotor.errors import LinkError, QuadlabError, RefusedError
from quadrotor.parameters import ParameterDescription

WAITING_MOST = 8
"""Most requests of one ground station that wait at a time."""
UNANSWERED = "no answer: "
"""Begins the reason of a command whose outcome is unknown."""
EMERGENCY_TRIES = 5
"""How often an emergency is sent while nobody answers."""

Then = Callable[[Any, str], None]
"""Called in the gateway's thread with the answer and "", or with None and the reason."""


class Client(Protocol):
    """What is used of `quadlab.station_client.StationClient`."""

    def ask(self, service: str, **fields: Any) -> Any: ...
    def descriptions(self) -> list[ParameterDescription]: ...
    def parameters(self) -> dict[str, Any]: ...
    def close(self) -> None: ...


class Operator:
    """One requester; its work is done in a thread, and each result is collected by the gateway."""

    def __init__(self, name: str, connect: Callable[[str], Client], results: Results) -> None:
        self.name, self._connect, self._results = name, connect, results
        self._client: Client | None = None
        self._connecting = threading.Lock()
        self._pools = {urgent: ThreadPoolExecutor(1 + urgent) for urgent in (False, True)}
        self._waiting = 0

    def ask(self, then: Then, service: str, **fields: Any) -> None:
        """Ask the station for a command; `then` gets its answer."""
        self.start(then, lambda client: client.ask(service, **fields))

    def emergency(self, then: Then, action: str) -> None:
        """Command an emergency, which waits for no other command, until somebody answers."""

        def work(client: Client) -> Any:
            for _ in range(EMERGENCY_TRIES - 1):
                try:
                    return client.ask("emergency", action=action)
                except LinkError:
                    continue
            return client.ask("emergency", action=action)

        self.start(then, work, urgent=True)

    def start(self, then: Then, work: Callable[[Client], Any], *, urgent: bool = False) -> None:
        """Do work with the client in a thread."""
        if self._waiting >= WAITING_MOST and not urgent:
            then(None, f"{WAITING_MOST} commands of {self.name} wait already; wait for an answer")
            return
        self._waiting += 1

        def run() -> None:
            answer, reason = None, ""
            try:
                with self._connecting:
                    if self._client is None:
                        self._client = self._connect(self.name)
                answer = work(self._client)
            except RefusedError as error:
                reason = str(error)
            except QuadlabError as error:
                reason = f"{UNANSWERED}{error}"
            except Exception as error:
                self._results.put(partial(_raise, error))
                return
            self._results.put(lambda: self._give(then, answer, reason))

        self._pools[urgent].submit(run)

    def _give(self, then: Then, answer: Any, reason: str) -> None:
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


def _raise(error: Exception) -> None:
    raise error


class Results(queue.SimpleQueue[Callable[[], None]]):
    """What has been answered and waits for the gateway's thread."""

    def deliver(self) -> None:
        """Call what waits."""
        while True:
            try:
                give = self.get_nowait()
            except queue.Empty:
                return
            give()


class Operators:
    """The requesters by name. `connect` makes a client of the station; it may raise LinkError."""

    def __init__(self, connect: Callable[[str], Client]) -> None:
        self._connect, self.results = connect, Results()
        self._operators: dict[str, Operator] = {}

    def of(self, name: str) -> Operator:
        """Return the requester with this name. Raises RefusedError when there are too many."""
        if name not in self._operators:
            if len(self._operators) >= MOST:
                raise RefusedError(f"{MOST} ground stations command already; close one")
            self._operators[name] = Operator(name, self._connect, self.results)
        return self._operators[name]

    def left(self, name: str) -> None:
        """Release what a requester holds who has left."""
        if (one := self._operators.pop(name, None)) is not None:
            one.close()

    def close(self) -> None:
        for name in list(self._operators):
            self.left(name)
