"""The lease at the station: requested and published over the station's session.

Serves `/<vehicle>/station/control`; publishes `control` at 2 Hz and on change; receives `presence`,
the names of those who have a page open. Every command of the gateway passes `permit`.
"""

from __future__ import annotations

import threading
import time

from console.commands.lease import ControlLease
from console.context import StationContext
from console.link.outbox import INFO
from quadrotor.errors import UsageError
from vehicle_link.messages import decode, header, new
from vehicle_link.messages.records import ControlRequest, Message
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.idempotent import Idempotent
from vehicle_link.transport.publisher import Received

ANSWER = f"{SERVICES['control']}_Response"
OWN = ("quadlab up",)
"""Our own requesters, which may end a flight no matter who has control; names of people have no
spaces, or end in a number."""
EVERY = 10  # heartbeats between two messages without a change


class LeaseService:
    """The lease with its service and topics; thread-safe."""

    def __init__(self, context: StationContext) -> None:
        self._context = context
        self._lease = ControlLease()
        self._lock = threading.Lock()
        self._published = ("", "")
        node, presence = context.node, TOPICS["presence"]
        node.serve("station/control", SERVICES["control"], Idempotent(self._answer))
        node.subscribe(presence.name, presence.type_name, self._on_presence, qos=presence.qos)

    def permit(self, command: str, requester: str) -> None:
        """Permit a command of this requester. Raises RefusedError when someone else has control.

        Everyone may send an emergency, and it gives no one control.
        """
        if command == "emergency" or requester in OWN:
            return
        with self._lock:
            self._lease.command(requester or "someone", time.monotonic())
        self._publish()

    def accepts_sticks(self, requester: str, enabled: bool) -> bool:
        """Return whether these sticks count; released sticks request nothing.

        Sticks without a requester (a joystick at the base, through ROS 2) belong to the holder of
        the lease.
        """
        if not requester:
            return True
        with self._lock:
            now = time.monotonic()
            if not self._lease.may_command(requester, now):
                return False
            if enabled:
                self._lease.command(requester, now)
        self._publish()
        return True

    def tick(self, count: int) -> None:
        """Advance the lease; called every 50 ms."""
        with self._lock:
            self._lease.expire(time.monotonic())
        self._publish(count % EVERY == 0)

    def _on_presence(self, received: Received) -> None:
        names = decode(received.payload, TOPICS["presence"].type_name).names
        with self._lock:
            for name in names:
                self._lease.present(str(name), time.monotonic())

    def _answer(self, request: ControlRequest) -> Message:
        try:
            with self._lock:
                self._do(request.action, request.requester or "someone", time.monotonic())
        finally:
            self._publish()
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
                f"unknown action {action!r}; allowed are ask, give, keep, release and take"
            )

    def _publish(self, always: bool = False) -> None:
        with self._lock:
            view, published = self._lease.view(time.monotonic()), self._published
            self._published = (view.holder, view.asking)
        if self._published == published and not always:
            return
        if view.holder != published[0]:
            self._context.outbox.say(INFO, f"{view.holder} has control" if view.holder else _FREE)
        stamp_ns = self._context.link.vehicle_ns()
        message = new(
            "quadlab_msgs/ControlStatus",
            header=header(stamp_ns),
            holder=view.holder,
            asking=view.asking,
            answer_within=view.answer_within,
        )
        self._context.outbox.message("control", message, stamp_ns)


_FREE = "nobody has control; the next command takes it"
