"""The calling side of a service."""

from __future__ import annotations

import itertools
import threading
import time
from typing import Any

import zenoh

from quadrotor.errors import LinkError
from vehicle_link.messages import Message, decode, encode
from vehicle_link.rmw_keys import attachment

TIMEOUT = 1.0
"""s; a command is worth repeating under the same request id for 5 s, not waiting for longer."""


class NoAnswerError(LinkError):
    """The question or its answer may have been lost: worth asking again under the same id."""


def wait_for_match(entity: zenoh.Querier | zenoh.Publisher, timeout: float) -> bool:
    """Whether a querier has a service, or a publisher a subscription, waiting at most `timeout`."""
    matched = threading.Event()

    def changed(status: zenoh.MatchingStatus) -> None:
        if status.matching:
            matched.set()

    with entity.declare_matching_listener(changed):
        now: Any = entity.matching_status  # the listener tells of changes only
        return now.matching or matched.wait(timeout)


class ServiceClient:
    """Made by `Node.client`; may be called from several threads."""

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
        self._priority = priority  # of the answer too
        self._sequence = itertools.count(1)

    def wait(self, timeout: float) -> bool:
        """Whether the service can be reached, waiting for it for at most `timeout` seconds."""
        return wait_for_match(
            self._session.declare_querier(self._key, target=zenoh.QueryTarget.ALL_COMPLETE), timeout
        )

    def call(self, request: Message, timeout: float = TIMEOUT) -> Message:
        """The response; blocks for at most `timeout` seconds.

        Raises:
            NoAnswerError: nobody answered in time.
            LinkError: the service answered with an error.
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
            raise LinkError(f"cannot call {self._name}: {error}") from error
        for reply in replies:
            if reply.ok is not None:
                return decode(reply.ok.payload.to_bytes(), f"{self._type}_Response")
            text = reply.err.payload.to_string() if reply.err else ""
            if text != "Timeout":  # Zenoh's own way of saying that time is up
                raise LinkError(f"{self._name}: {text}")
        if time.monotonic() - started < 0.5 * timeout:  # nobody to wait for
            raise NoAnswerError(
                f"nobody serves {self._name}; is the other end running and the link up?"
            )
        raise NoAnswerError(f"{self._name} did not answer within {timeout:g} s; is the link up?")
