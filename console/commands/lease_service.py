"""The lease at the station: requested and published over the station's session.

Serves `/<vehicle>/station/control`; publishes `control` at 2 Hz and on change; receives `presence`,
the names of those who have a page open. Every command of the gateway passes `permit`.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from console.commands.lease import ControlLease
from console.link.outbox import Outbox
from quadrotor.errors import UsageError
from vehicle_link.messages import decode, header, new
from vehicle_link.topics import SERVICES, TOPICS
from vehicle_link.transport.idempotent import Idempotent
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received

INFO = 20
ANSWER = f"{SERVICES['control']}_Response"
OWN = ("quadlab up",)
"""Our own requesters, which may end a flight no matter who has control; names of people have no
spaces, or end in a number."""
EVERY = 10  # heartbeats between two messages without a change


class ControlDesk:
    """The lease with its service and topics; thread-safe. `clock` is steady, in s."""

    def __init__(
        self,
        node: Node,
        outbox: Outbox,
        vehicle_ns: Callable[[], int],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._outbox = outbox
        self._vehicle_ns = vehicle_ns
        self._clock = clock
        self._lease = ControlLease()
        self._lock = threading.Lock()
        self._told = ("", "")
        node.serve("station/control", SERVICES["control"], Idempotent(self._answer))
        presence = TOPICS["presence"]
        node.subscribe(presence.name, presence.type_name, self._on_presence, qos=presence.qos)

    def permit(self, command: str, requester: str) -> None:
        """Permit a command of this requester. Raises RefusedError when another has control.

        Everyone may send an emergency, and it gives no one control.
        """
        if command == "emergency" or requester in OWN:
            return
        with self._lock:
            self._lease.command(requester or "someone", self._clock())
        self._tell()

    def steers(self, requester: str, enabled: bool) -> bool:
        """Return whether these sticks count; released sticks request nothing.

        Sticks without a requester (a joystick at the base, through ROS 2) belong to the holder of
        the lease.
        """
        if not requester:
            return True
        with self._lock:
            now = self._clock()
            if not self._lease.may_command(requester, now):
                return False
            if enabled:
                self._lease.command(requester, now)
        self._tell()
        return True

    def tick(self, count: int) -> None:
        """Advance the lease; called every 50 ms."""
        with self._lock:
            self._lease.expire(self._clock())
        self._tell(count % EVERY == 0)

    def _on_presence(self, received: Received) -> None:
        names = decode(received.payload, TOPICS["presence"].type_name).names
        with self._lock:
            for name in names:
                self._lease.present(str(name), self._clock())

    def _answer(self, request: Any) -> Any:
        try:
            with self._lock:
                self._do(request.action, request.requester or "someone", self._clock())
        finally:
            self._tell()
        return new(ANSWER, accepted=True)

    def _do(self, action: str, who: str, now: float) -> None:
        lease = self._lease
        if action == "ask":
            lease.ask(who, now)
        elif action in ("give", "keep"):
            lease.answer(who, action == "give", now)
        elif action == "release":
            lease.release(who, now)
        elif action == "take":  # the page allows admins only; this session is the station's own
            lease.take(who, now)
        else:
            raise UsageError(
                f"{action!r} is no action; there are ask, give, keep, release and take"
            )

    def _tell(self, always: bool = False) -> None:
        with self._lock:
            view, told = self._lease.view(self._clock()), self._told
            self._told = (view.holder, view.asking)
        if self._told == told and not always:
            return
        if view.holder != told[0]:
            self._outbox.say(INFO, f"{view.holder} has control" if view.holder else _FREE)
        stamp_ns = self._vehicle_ns()
        message = new(
            "quadlab_msgs/ControlStatus",
            header=header(stamp_ns),
            holder=view.holder,
            asking=view.asking,
            answer_within=view.answer_within,
        )
        self._outbox.message("control", message, stamp_ns)


_FREE = "no one has control; the next command takes it"
