"""Commands to the flight process through the inbox ring, and the return of its replies."""

from __future__ import annotations

import itertools
import os
import threading
from collections.abc import Callable, Mapping

import numpy as np

from quadrotor.errors import LinkError, NoAnswerError, ParameterError
from quadrotor.parameter_description import ParameterDescription, ParameterValue
from quadrotor.parameters import ParameterStore
from quadrotor.records import Record
from vehicle import mailbox
from vehicle.parameters import new_parameters
from vehicle.processes.config import Rings
from vehicle_link.commands import Request
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.parameters.replica import ParameterReplica

REPLY_TIMEOUT_S = 1.0
FETCH_PATIENCE_S = 1.5  # shorter than the timeout of a parameter client


class FlightMailbox:
    """The sending side of the rings to flight, shared by all threads of this process."""

    def __init__(self, rings: Rings) -> None:
        self._inbox = rings.inbox
        self._measured = {ring.dtype: ring for ring in (rings.poses, rings.bearings)}
        self._lock = threading.Lock()
        self._waiting: dict[str, tuple[threading.Event, list[mailbox.Reply]]] = {}
        # The process id distinguishes our replies from those to a comms process that died.
        self._ids = (f"{os.getpid()}-{k}" for k in itertools.count())

    def send(self, message: mailbox.Inbound | Request | Record) -> bool:
        """Push a message, POSE_SAMPLE or BEARINGS_SAMPLE (1,) into its ring without waiting.

        Returns False when the ring is full.
        """
        if isinstance(message, np.ndarray):
            with self._lock:
                return self._measured[message.dtype].push(message)
        data = mailbox.encode(message)
        with self._lock:
            return self._inbox.push(data)

    def ask(
        self, make: Callable[[str], Request], timeout_s: float = REPLY_TIMEOUT_S
    ) -> mailbox.Reply:
        """Send the command that `make` builds for a request id, and wait for its reply.

        Raises NoAnswerError when the flight process does not answer in time. Must not be called on
        the thread that calls `deliver`.
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
        """Wake the thread that waits for this reply; there is none if it arrived too late."""
        waiting = self._waiting.get(reply.request_id)
        if waiting is not None:
            answered, replies = waiting
            replies.append(reply)
            answered.set()


class FlightParameters:
    """The flight process's parameters, as the parameter services show and change them.

    The flight process checks and applies changes; the replica follows what it reports.
    """

    def __init__(self, flight: FlightMailbox, preset: Mapping[str, ParameterValue]) -> None:
        self._flight = flight
        store = ParameterStore(new_parameters())
        store.preset(preset)
        self._descriptions = store.descriptions()
        self.replica = ParameterReplica(store.values())
        """A copy that has the initial values until flight has reported its own."""
        self._fetched = threading.Event()
        self._fetch_id = f"{os.getpid()}-all"

    def descriptions(self) -> tuple[ParameterDescription, ...]:
        return self._descriptions

    @property
    def complete(self) -> bool:
        """Return whether the replica holds flight's values rather than the initial ones."""
        return self._fetched.is_set()

    def values(self) -> dict[str, ParameterValue]:
        """Return flight's values; wait for them when this process has just started.

        Raises LinkError when flight does not report them, as the initial ones may be wrong.
        """
        if not self._fetched.wait(FETCH_PATIENCE_S):
            raise LinkError(
                f"the flight process did not report its parameters within {FETCH_PATIENCE_S:g} s; "
                "is the microcontroller connected?"
            )
        return self.replica.values()

    def change(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> tuple[dict[str, ParameterValue], int]:
        """Return (applied values, revision) from the flight process.

        Raises ParameterError with its reason, or LinkError when it does not answer.
        """
        if not values:
            return {}, self.replica.revision
        reply = self._flight.ask(lambda i: mailbox.ChangeParameters(i, requester, dict(values)))
        if not reply.accepted:
            raise ParameterError(reply.reason)
        return reply.applied, reply.revision

    def fetch(self) -> None:
        """Request all values: a comms process that was restarted has missed changes."""
        self._flight.send(mailbox.ChangeParameters(self._fetch_id, "comms", {}))

    def describe(self, described: mailbox.Described) -> None:
        """Add a parameter that the board alone knows."""
        one = described.description
        self._descriptions = (*(d for d in self._descriptions if d.name != one.name), one)

    def deliver(self, reply: mailbox.Reply) -> None:
        """Load all values if this is the reply to `fetch`."""
        if reply.request_id == self._fetch_id:
            self.replica.load(reply.applied, reply.revision)
            self._fetched.set()

    def changed(self, change: ParameterChange) -> None:
        """Apply a change that the flight process reported."""
        self.replica.apply({change.name: change.new}, change.revision)
