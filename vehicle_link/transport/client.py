"""Clients of services."""

from __future__ import annotations

import itertools
import logging
import threading
import time
import uuid
from typing import TYPE_CHECKING, Generic, TypeVar, cast, overload

import zenoh

from quadrotor.errors import LinkError, NoAnswerError, RefusedError, UnreachableError
from vehicle_link.messages import Message, decode, encode, new
from vehicle_link.topics.rmw_keys import attachment

if TYPE_CHECKING:
    from vehicle_link.messages.records import Answer, CommandRequest, Request

log = logging.getLogger(__name__)
A = TypeVar("A", bound=Message)
A_co = TypeVar("A_co", bound=Message, covariant=True)

TIMEOUT = 1.0
"""Seconds to wait for an answer; a command should be repeated under the same request id for 5 s
rather than waited for longer."""

UNREACHED_WITHIN = 0.1
"""Seconds within which a request that reaches no service fails; one that fails later may have been
executed."""

KINDS: dict[str, type[LinkError]] = {"no answer": NoAnswerError, "unreachable": UnreachableError}
"""Errors that keep their type between a service and its client, by the schema of the error reply's
encoding; all others become a LinkError."""


def encoding_of(error: Exception) -> zenoh.Encoding:
    """Return the encoding of an error reply, which carries the kind of the error."""
    kind = next((name for name, one in KINDS.items() if type(error) is one), "")
    text = zenoh.Encoding.TEXT_PLAIN
    return text.with_schema(kind) if kind else text


def peer_of(name: str) -> str:
    """Return which program serves a service, in words for users, who do not know services."""
    parts = name.split("/")
    if "station" in parts:
        return "the base station"
    return "the simulator" if "simulator" in parts else "the vehicle"


def wait_for_match(entity: zenoh.Querier | zenoh.Publisher, timeout: float) -> bool:
    """Wait at most `timeout` seconds until a querier has a service, or a publisher a subscription;
    return whether it has one.
    """
    matched = threading.Event()

    def changed(status: zenoh.MatchingStatus) -> None:
        if status.matching:
            matched.set()

    with entity.declare_matching_listener(changed):
        now = cast("zenoh.MatchingStatus", entity.matching_status)  # a listener reports changes
        return now.matching or matched.wait(timeout)


class ServiceClient(Generic[A_co]):
    """Client of one service, made by `Node.client`; thread-safe."""

    def __init__(
        self,
        session: zenoh.Session,
        name: str,
        key: str,
        srv_type: str,
        gid: bytes,
        priority: zenoh.Priority = zenoh.Priority.INTERACTIVE_HIGH,
    ) -> None:
        self._session = session
        self._name = name
        self._key = key
        self._type = srv_type
        self._gid = gid
        self._priority = priority  # also of the answer
        self._sequence = itertools.count(1)

    def wait(self, timeout: float) -> bool:
        """Wait for the service for at most `timeout` seconds; return whether it can be reached."""
        return wait_for_match(
            self._session.declare_querier(self._key, target=zenoh.QueryTarget.ALL_COMPLETE), timeout
        )

    def ask(
        self, requester: str, *, timeout: float = TIMEOUT, tries: int = 1, **fields: object
    ) -> A_co:
        """Return the answer to a request with these fields, if it was accepted.

        Args:
            timeout: s for each try.
            tries: a lost answer is requested again, with the same request id.

        Raises RefusedError with the reason, or as `call` does.
        """
        request = new(f"{self._type}_Request", requester=requester, **fields)
        if not getattr(request, "request_id", "set"):
            cast("CommandRequest", request).request_id = uuid.uuid4().hex
        for left in reversed(range(tries)):
            try:
                response = self.call(request, timeout)
                break
            except LinkError:
                if not left:
                    raise
        answer = cast("Answer", response)
        if not answer.accepted:
            service = self._name.rpartition("/")[2]
            reason = str(answer.reason) or f"{service} was refused without a reason"
            raise RefusedError(reason, str(getattr(answer, "kind", "")))
        return response

    @overload
    def call(self, request: Request[A], timeout: float = TIMEOUT) -> A: ...

    @overload
    def call(self, request: Message, timeout: float = TIMEOUT) -> A_co: ...

    def call(self, request: Message, timeout: float = TIMEOUT) -> Message:
        """Return the response; blocks for at most `timeout` seconds.

        Raises:
            UnreachableError: no service was reached.
            NoAnswerError: no answer arrived in time, here or where the service forwarded the
                request, or contact broke in the meantime.
            LinkError: the service answered with another error.
        """
        started = time.monotonic()
        try:
            replies = self._session.get(
                self._key,
                target=zenoh.QueryTarget.ALL_COMPLETE,
                consolidation=zenoh.ConsolidationMode.NONE,
                timeout=timeout,
                congestion_control=zenoh.CongestionControl.BLOCK,
                priority=self._priority,
                express=self._priority != zenoh.Priority.BACKGROUND,
                payload=encode(request),
                attachment=attachment(next(self._sequence), time.time_ns(), self._gid),
            )
        except zenoh.ZError as error:
            raise LinkError(f"{peer_of(self._name)} cannot be asked: {error}") from error
        for reply in replies:
            if reply.ok is not None:
                return decode(reply.ok.payload.to_bytes(), f"{self._type}_Response")
            text = reply.err.payload.to_string() if reply.err else ""
            if reply.err and text != "Timeout":  # Zenoh's own word for a time-out
                kind = str(reply.err.encoding).partition(";")[2]
                raise KINDS.get(kind, LinkError)(text)
        waited, peer = time.monotonic() - started, peer_of(self._name)
        log.debug("%s: no answer in %.3f s of %g s", self._name, waited, timeout)
        if waited < UNREACHED_WITHIN:
            raise UnreachableError(f"{peer} cannot be reached; is it running?")
        if waited < 0.9 * timeout:  # it was reached, and since then it or the link has ended
            raise NoAnswerError(f"contact with {peer} broke before it answered")
        raise NoAnswerError(f"{peer} has not answered within {timeout:g} s")
