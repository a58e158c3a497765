"""Commands through the inbox ring, and their replies back to whoever waits."""

from __future__ import annotations

import itertools
import os
import threading
from collections.abc import Callable, Mapping

from quadrotor.errors import LinkError, NoAnswerError, ParameterError
from quadrotor.parameters import ParameterDescription, ParameterStore, ParameterValue
from vehicle.parameters import new_parameters
from vehicle.processes import mailbox
from vehicle.processes.rings import ByteRing

REPLY_TIMEOUT_S = 1.0
FETCH_PATIENCE_S = 1.5  # less than a parameter client waits


class FlightMailbox:
    """The producer's side of the inbox ring, shared by all threads of this process."""

    def __init__(self, inbox: ByteRing) -> None:
        self._inbox = inbox
        self._lock = threading.Lock()
        self._waiting: dict[str, tuple[threading.Event, list[mailbox.Reply]]] = {}
        # The process id keeps replies to a comms process that died from being taken for ours.
        self._ids = (f"{os.getpid()}-{k}" for k in itertools.count())

    def send(self, message: mailbox.Inbound) -> bool:
        """Put into the ring without waiting; False when there is no room."""
        data = mailbox.encode(message)
        with self._lock:
            return self._inbox.push(data)

    def ask(
        self, make: Callable[[str], mailbox.Command], timeout_s: float = REPLY_TIMEOUT_S
    ) -> mailbox.Reply:
        """Send the command that `make` builds for a request id, and wait for its reply.

        Raises NoAnswerError when the flight process does not answer in time. Not for the thread
        that calls `deliver`.
        """
        with self._lock:
            request_id = next(self._ids)
        command = make(request_id)
        answered, replies = threading.Event(), list[mailbox.Reply]()
        self._waiting[request_id] = (answered, replies)
        try:
            size = len(mailbox.encode(command))
            if size > self._inbox.longest:
                raise LinkError(
                    f"command of {size} bytes is too long, at most {self._inbox.longest}; "
                    "send fewer values at a time"
                )
            if not self.send(command):
                raise LinkError("the flight process does not take commands: its inbox is full")
            if not answered.wait(timeout_s):
                raise NoAnswerError(
                    f"the flight process has not answered within {timeout_s:g} s; "
                    "see the vehicle's terminal"
                )
        finally:
            del self._waiting[request_id]
        return replies[0]

    def deliver(self, reply: mailbox.Reply) -> None:
        """Wake who waits for this reply; no one may, if it came too late."""
        waiting = self._waiting.get(reply.request_id)
        if waiting is not None:
            answered, replies = waiting
            replies.append(reply)
            answered.set()


class ParameterMirror:
    """A copy of the flight process's parameters: what the parameter services answer from.

    The flight process is the only writer; its `ParameterChange`s keep the copy true.
    """

    def __init__(self, flight: FlightMailbox, preset: Mapping[str, ParameterValue]) -> None:
        self._flight = flight
        self._store = ParameterStore(new_parameters())
        self._store.preset(preset)
        self._values = self._store.values()
        self.revision = 0
        self._fetched = threading.Event()
        self._fetch_id = f"{os.getpid()}-all"

    def descriptions(self) -> tuple[ParameterDescription, ...]:
        return self._store.descriptions()

    @property
    def complete(self) -> bool:
        """Return whether it holds flight's values, not only those of the start."""
        return self._fetched.is_set()

    def values(self) -> dict[str, ParameterValue]:
        """Return flight's values; waits for them when this process has just started.

        Raises LinkError when flight does not tell them: old ones would be a lie.
        """
        if not self._fetched.wait(FETCH_PATIENCE_S):
            raise LinkError(
                f"the flight process did not tell its parameters within {FETCH_PATIENCE_S:g} s; "
                "is the microcontroller connected?"
            )
        return dict(self._values)

    def newest(self) -> dict[str, ParameterValue]:
        """Return the values as far as they are known, without waiting: those of the start until
        flight has reported its own.
        """
        return dict(self._values)

    def change(
        self, values: Mapping[str, object], requester: str
    ) -> tuple[dict[str, ParameterValue], int]:
        """Return (applied values, revision) from the flight process.

        Raises ParameterError with its reason, or LinkError when it does not answer.
        """
        # Checked here too: only then are the values of types the mailbox can carry.
        checked = {name: self._store.check(name, value) for name, value in values.items()}
        if not checked:
            return {}, self.revision
        reply = self._flight.ask(lambda i: mailbox.ChangeParameters(i, requester, checked))
        if not reply.accepted:
            raise ParameterError(reply.reason)
        return reply.applied, reply.revision

    def fetch(self) -> None:
        """Ask for all values: a comms process that was restarted has missed changes."""
        self._flight.send(mailbox.ChangeParameters(self._fetch_id, "comms", {}))

    def deliver(self, reply: mailbox.Reply) -> None:
        """Take over all values if this is the reply to `fetch`."""
        if reply.request_id == self._fetch_id:
            self._values.update(reply.applied)
            self.revision = reply.revision
            self._fetched.set()

    def changed(self, change: mailbox.ParameterChange) -> None:
        """Take over a change that the flight process applied."""
        self._values[change.name] = change.new
        self.revision = change.revision
