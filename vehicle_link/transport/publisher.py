"""A publisher of a node, and a message as its subscribers get it."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import zenoh
import zenoh.ext

from quadrotor.errors import LinkError
from vehicle_link import clock
from vehicle_link.topics.rmw_keys import attachment

AnyPublisher = zenoh.Publisher | zenoh.ext.AdvancedPublisher


@dataclass(frozen=True, slots=True)
class Received:
    """One message as received; `decode` of vehicle_link.messages or topics decodes its payload."""

    payload: bytes
    sequence: int  # of its publisher, from 1
    source_ns: int  # the publisher's stamp
    received_ns: int  # clock.time_ns here
    gid: bytes = b""  # of its publisher


@dataclass(frozen=True, slots=True)
class OtherPath:
    """Another path that the messages of a publisher take as well.

    Attributes:
        send: called with each message before it is published; returns whether the path works.
        publish_one_in: while it works, one message in so many is published, too.
    """

    send: Callable[[Received], bool]
    publish_one_in: int = 1


class Publisher:
    """Publisher of one topic, made by `Node.advertise`."""

    def __init__(self, publisher: AnyPublisher, gid: bytes, other: OtherPath | None = None) -> None:
        self._publisher = publisher
        self._gid = gid
        self._sequence = itertools.count(1)
        self._other = other

    def put(self, payload: bytes, source_ns: int | None = None) -> None:
        """Publish CDR bytes.

        Args:
            source_ns: source time in ns; now (clock.time_ns) when not given.

        Raises:
            LinkError: the session is closed.
        """
        stamp = clock.time_ns() if source_ns is None else source_ns
        sequence = next(self._sequence)
        if (other := self._other) is not None:
            is_sent = other.send(Received(payload, sequence, stamp, stamp, self._gid))
            if is_sent and sequence % other.publish_one_in:
                return
        try:
            self._publisher.put(payload, attachment=attachment(sequence, stamp, self._gid))
        except (zenoh.ZError, RuntimeError) as error:  # RuntimeError: it is being undeclared
            raise LinkError(f"cannot publish, the session is closed ({error})") from error

    @property
    def has_subscribers(self) -> bool:
        """Return whether any node subscribes, or may do so later and get what is kept; False when
        the session is closed.
        """
        if isinstance(self._publisher, zenoh.ext.AdvancedPublisher):
            return True
        try:
            status: Any = self._publisher.matching_status
        except zenoh.ZError:
            return False
        return bool(status.matching)
