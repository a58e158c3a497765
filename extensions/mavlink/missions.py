"""The stored mission, its upload and its download (the mission protocol of MAVLink)."""

from __future__ import annotations

from collections.abc import Callable

from control.behaviors.way_points import COUNT_MAX
from extensions.mavlink.dialect import MAVLink_message, mavlink
from extensions.mavlink.frames import Origin
from extensions.mavlink.mission_steps import Step, steps_of
from extensions.mavlink.peer import Peer
from quadrotor.errors import RefusedError

ITEMS_MOST = 2 * COUNT_MAX + 2
ASKED_AGAIN, TRIES = 0.5, 6
"""Seconds after which an item is asked for again, and how often before an upload is given up."""


class Missions:
    """The stored mission, and the upload under way.

    Args:
        may_upload: returns why a ground station may not upload, or "".
        say: tells a ground station a line, and prints it.
    """

    def __init__(
        self, origin: Origin, may_upload: Callable[[Peer], str], say: Callable[[Peer, str], None]
    ) -> None:
        self._origin, self._may_upload, self._say = origin, may_upload, say
        self.items: tuple[MAVLink_message, ...] = ()
        self.steps: list[Step] = []
        self._from: Peer | None = None
        self._count, self._arrived, self._asked, self._tries = 0, list[MAVLink_message](), 0.0, 0

    def take(self, peer: Peer, message: MAVLink_message, now: float) -> None:
        """Take a message of the mission protocol; `now` in s of a steady clock."""
        kind = message.get_type()
        if kind == "MISSION_ACK":
            return
        if getattr(message, "mission_type", 0) != mavlink.MAV_MISSION_TYPE_MISSION:
            if kind == "MISSION_REQUEST_LIST":
                peer.send(self._count_message(peer, 0, message.mission_type))
            else:
                self._acknowledge(peer, mavlink.MAV_MISSION_UNSUPPORTED, message.mission_type)
        elif kind == "MISSION_REQUEST_LIST":
            peer.send(self._count_message(peer, len(self.items), 0))
        elif kind in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
            self._send_item(peer, message.seq)
        elif kind == "MISSION_COUNT":
            self._begin(peer, message.count, now)
        elif kind == "MISSION_ITEM_INT":
            self._add(peer, message, now)
        elif kind == "MISSION_CLEAR_ALL":
            if self._is_allowed(peer):
                self.items, self.steps = (), []
                self._acknowledge(peer, mavlink.MAV_MISSION_ACCEPTED)
        else:
            self._acknowledge(peer, mavlink.MAV_MISSION_UNSUPPORTED)

    def tick(self, now: float) -> None:
        """Ask again for an item that has not come, or give the upload up."""
        peer = self._from
        if peer is None or now - self._asked < ASKED_AGAIN:
            return
        if self._tries >= TRIES:
            self._from = None
            self._acknowledge(peer, mavlink.MAV_MISSION_OPERATION_CANCELLED)
            self._say(peer, f"mission upload given up at item {len(self._arrived)}: no answer")
        else:
            self._ask(now)

    def _begin(self, peer: Peer, count: int, now: float) -> None:
        if not self._is_allowed(peer):
            return
        if self._from not in (None, peer):
            self._refuse(
                peer, "another ground station uploads a mission", mavlink.MAV_MISSION_DENIED
            )
            return
        if not 1 <= count <= ITEMS_MOST:
            line = f"a mission of {count} items; allowed are 1 to {ITEMS_MOST}"
            self._refuse(peer, line, mavlink.MAV_MISSION_NO_SPACE)
            return
        self._from, self._count, self._arrived, self._tries = peer, count, [], 0
        self._ask(now)

    def _add(self, peer: Peer, item: MAVLink_message, now: float) -> None:
        if peer is not self._from or item.seq != len(self._arrived):
            return  # repeated, or late
        self._arrived.append(item)
        self._tries = 0
        if len(self._arrived) < self._count:
            self._ask(now)
            return
        self._from = None
        try:
            self.steps = steps_of(self._arrived, self._origin)
        except RefusedError as error:
            self._refuse(peer, str(error), mavlink.MAV_MISSION_UNSUPPORTED)
            return
        self.items = tuple(self._arrived)
        self._acknowledge(peer, mavlink.MAV_MISSION_ACCEPTED)

    def _ask(self, now: float) -> None:
        assert self._from is not None
        self._asked, self._tries = now, self._tries + 1
        self._from.send(
            mavlink.MAVLink_mission_request_int_message(
                self._from.system, 0, len(self._arrived), mavlink.MAV_MISSION_TYPE_MISSION
            )
        )

    def _send_item(self, peer: Peer, seq: int) -> None:
        if not 0 <= seq < len(self.items):
            self._acknowledge(peer, mavlink.MAV_MISSION_INVALID_SEQUENCE)
            return
        one = self.items[seq]
        numbers = (one.param1, one.param2, one.param3, one.param4, one.x, one.y, one.z)
        peer.send(
            mavlink.MAVLink_mission_item_int_message(
                *(peer.system, 0, seq, one.frame, one.command, int(seq == 0), one.autocontinue),
                *numbers,
                mavlink.MAV_MISSION_TYPE_MISSION,
            )
        )

    def _is_allowed(self, peer: Peer) -> bool:
        if reason := self._may_upload(peer):
            self._refuse(peer, reason, mavlink.MAV_MISSION_DENIED)
        return not reason

    def _refuse(self, peer: Peer, line: str, result: int) -> None:
        self._acknowledge(peer, result)
        self._say(peer, f"mission refused: {line}")

    def _acknowledge(self, peer: Peer, result: int, kind: int = 0) -> None:
        peer.send(mavlink.MAVLink_mission_ack_message(peer.system, 0, result, kind))

    def _count_message(self, peer: Peer, count: int, kind: int) -> MAVLink_message:
        return mavlink.MAVLink_mission_count_message(peer.system, 0, count, kind)
