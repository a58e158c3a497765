"""A command's connection to the running station of this machine: services and experiment status."""

from __future__ import annotations

import getpass
import queue
import threading
import uuid
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, cast

from quadrotor.errors import LinkError, RefusedError
from quadrotor.parameter_description import ParameterDescription, ParameterValue
from vehicle_link import clock
from vehicle_link.clock import monotonic_ns
from vehicle_link.lockstep import page_at
from vehicle_link.messages import decode, encode, new
from vehicle_link.messages.records import Answer, ExperimentStatus, Message
from vehicle_link.termination_signal import Ending
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.client import ServiceClient
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.parameter_service import ParameterClient
from vehicle_link.transport.publisher import Publisher, Received

if TYPE_CHECKING:
    from vehicle_link.topics.typed_tables import Ask
    from vehicle_link.transport.loopback import Session

REACH = 3.0
"""Seconds to wait until a station is reached."""
ANSWER = 6.0
"""Seconds to wait for an answer, for which the station may have to ask the vehicle."""
PRESENT = 1.0
"""Seconds between two messages that this person is present, for the control lease."""


class StationClient:
    """Client of a station, made by `station`; it gives commands in the name of this user, or of
    `requester`.

    Attributes:
        statuses: each ExperimentStatus as it is received.
    """

    def __init__(self, session: Session, vehicle: str, requester: str = "") -> None:
        self.requester = requester or f"{_user()} (terminal)"
        self._node = Node(session, f"/{vehicle}", f"terminal_{uuid.uuid4().hex[:8]}")
        self._parameters = ParameterClient(self._node, f"/{vehicle}/vehicle")
        self._clients: dict[str, ServiceClient[Answer]] = {}
        self.ask = cast("Ask", self._ask)
        """Return the station's answer if it accepted. Raises RefusedError with its reason, or
        LinkError.
        """
        self.statuses: queue.SimpleQueue[ExperimentStatus] = queue.SimpleQueue()
        status = TOPICS["experiment_status"]
        self._node.subscribe(status.name, status.type_name, self._on_status, qos=status.qos)
        self._presence = self._node.advertise(TOPICS["presence"])
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._hold_presence, name="presence", daemon=True)
        self._thread.start()

    def _ask(self, service: str, **fields: object) -> Answer:
        if service not in self._clients:
            self._clients[service] = self._node.client(f"station/{service}", SERVICES[service])
        return self._clients[service].ask(self.requester, timeout=ANSWER, tries=1, **fields)

    def listen(self, topic: str) -> queue.SimpleQueue[Message]:
        """Return a queue that receives the messages of a topic."""
        messages: queue.SimpleQueue[Message] = queue.SimpleQueue()
        row = TOPICS[topic]
        self._node.subscribe(
            row.name,
            row.type_name,
            lambda received: messages.put(decode(received.payload, row.type_name)),
            qos=row.qos,
        )
        return messages

    def newest(self, topic: str) -> Callable[[], Message | None]:
        """Return a function that decodes a topic's newest message; None before the first."""
        type_name, payload = TOPICS[topic].type_name, self.newest_payload(topic)
        return lambda: decode(newest[0], type_name) if (newest := payload()) else None

    def newest_payload(self, topic: str) -> Callable[[], tuple[bytes, int] | None]:
        """Return a function that returns a topic's newest message, encoded, and when it was
        received (ns of the flight's steady clock); None before the first.
        """
        row, arrived = TOPICS[topic], deque[tuple[bytes, int]](maxlen=1)
        self._node.subscribe(
            row.name,
            row.type_name,
            lambda received: arrived.append((received.payload, monotonic_ns())),
            qos=row.qos,
            direct=True,
        )
        return lambda: arrived[0] if arrived else None

    def advertise(self, topic: str) -> Publisher:
        """Return a publisher of a topic."""
        return self._node.advertise(TOPICS[topic])

    def descriptions(self) -> list[ParameterDescription]:
        """Return the descriptions of the vehicle's parameters. Raises LinkError."""
        return self._parameters.describe()

    def parameters(self) -> dict[str, ParameterValue]:
        """Return the vehicle's current values. Raises LinkError."""
        return self._parameters.values()

    def close(self) -> None:
        """Give up control, if we have it, and close."""
        self._closing.set()
        self._thread.join(2.0)
        with suppress(RefusedError, LinkError):
            self.ask("control", action="release")
        self._node.close()

    def _on_status(self, received: Received) -> None:
        self.statuses.put(decode(received.payload, TOPICS["experiment_status"].type_name))

    def _hold_presence(self) -> None:
        message = encode(new(TOPICS["presence"].type_name, names=[self.requester]))
        while True:
            with suppress(LinkError):
                self._presence.put(message)
            if self._closing.wait(PRESENT):
                return


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):  # a container without this user's name
        return "somebody"


def await_session(
    loopback_port: int, stopping: Ending, say: Callable[[str], None]
) -> Session | None:
    """Return a session of the running station, whose clock is followed, once there is one; None
    when this process is to end before.
    """
    is_reported = False
    while True:
        try:
            session = loopback_session(loopback_port)
            break
        except LinkError as error:
            if not is_reported:
                say(f"{error}; trying again")
            is_reported = True
            if stopping.wait(1.0):
                return None
    if clock.page() is None:  # the simulation may have begun after this process
        clock.follow(page_at(loopback_port, say))
    return session


@contextmanager
def station(loopback_port: int, vehicle: str) -> Iterator[StationClient]:
    """Yield a client of the running station. Raises LinkError when none runs."""
    try:
        session = loopback_session(loopback_port, REACH)
    except LinkError:
        raise LinkError(
            f"no station answers at 127.0.0.1:{loopback_port}; start `quadlab up`, or give its "
            "--link-port here as --loopback-port"
        ) from None
    client = StationClient(session, vehicle)
    try:
        yield client
    finally:
        client.close()
        session.close()
