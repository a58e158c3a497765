"""A publisher of a node, and a message as its subscribers get it."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import zenoh

from quadrotor.errors import LinkError
from vehicle_link import clock
from vehicle_link.transport.client import wait_for_match
from vehicle_link.transport.rmw_keys import attachment


@dataclass(frozen=True, slots=True)
class Received:
    """One message as it came; `decode` of vehicle_link.messages or topics makes sense of it."""

    payload: bytes
    sequence: int  # of its publisher, from 1
    source_ns: int  # as the publisher stamped it
    received_ns: int  # clock.time_ns here
    gid: bytes = b""  # of its publisher


class Publisher:
    """Made by `Node.publisher`.

    Attributes:
        beside: gets each message before it is put, to send it another way as well; whether that
            way works.
        every: of the messages that have gone a way that works, one in so many is put here too.
    """

    def __init__(self, publisher: zenoh.Publisher, gid: bytes) -> None:
        self._publisher = publisher
        self._gid = gid
        self._sequence = itertools.count(1)
        self.beside: Callable[[Received], bool] | None = None
        self.every = 1

    def put(self, payload: bytes, source_ns: int | None = None) -> None:
        """Send CDR bytes.

        Args:
            source_ns: source time in ns; now (clock.time_ns) when not given.

        Raises:
            LinkError: the session is closed.
        """
        stamp = clock.time_ns() if source_ns is None else source_ns
        sequence = next(self._sequence)
        if self.beside is not None:
            is_sent = self.beside(Received(payload, sequence, stamp, stamp, self._gid))
            if is_sent and sequence % self.every:
                return
        try:
            self._publisher.put(payload, attachment=attachment(sequence, stamp, self._gid))
        except (zenoh.ZError, RuntimeError) as error:  # RuntimeError: it is being undeclared
            raise LinkError(f"cannot publish, the session is closed ({error})") from error

    @property
    def is_heard(self) -> bool:
        """Return whether any node subscribes; False when the session is closed."""
        try:
            status: Any = self._publisher.matching_status
        except zenoh.ZError:
            return False
        return bool(status.matching)

    def wait(self, timeout: float) -> bool:
        """Wait for a subscriber for at most `timeout` seconds, and return whether there is one."""
        return wait_for_match(self._publisher, timeout)
