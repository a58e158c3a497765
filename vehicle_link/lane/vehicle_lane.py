"""Vehicle end of the lanes: one UDP socket, and a lane for each station that requested one."""

from __future__ import annotations

import contextlib
import os
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from vehicle_link import clock
from vehicle_link.addresses import EVERYWHERE
from vehicle_link.lane.datagram import (
    HELLO,
    KEY_SIZE,
    LARGEST_PAYLOAD,
    TO_VEHICLE,
    Opener,
    Refused,
    Sealer,
    key_id_of,
)
from vehicle_link.lane.lane_socket import Address, LaneSocket
from vehicle_link.messages import new
from vehicle_link.messages.records import LaneResponse
from vehicle_link.transport.publisher import Received

MAX_STATIONS = 8
"""Largest number of stations; one more replaces the one silent for the longest, receive-only
stations first."""
PATIENCE_NS = 2_000_000_000
"""Nanoseconds after a station's last datagram for which it is still sent to. Longer than most radio
outages: data then resume with the first packet that gets through, not with the next hello."""
PLACE_KEPT_NS = 60_000_000_000
"""Nanoseconds for which a silent station that may send keeps its place."""

Deliver = Callable[[str, Received], None]


@dataclass
class _Lane:
    instance: int  # of the station's process, as it reports it
    topics: tuple[str, ...]  # that it may send
    key_id: int
    sealer: Sealer = field(repr=False)
    opener: Opener = field(repr=False)
    since_ns: int  # of the grant or of the last datagram
    address: Address = None  # None until the first datagram

    @property
    def station(self) -> tuple[int, tuple[str, ...]]:
        """Return the instance and topics as identity: an instance is no secret, and a station that
        may only receive must not pass for one that may send.
        """
        return self.instance, self.topics

    @property
    def rank(self) -> tuple[bool, int]:
        """Return the sort key: stations that may send and are present rank highest, then those with
        the latest datagram.
        """
        is_there = clock.monotonic_ns() - self.since_ns < PLACE_KEPT_NS
        return len(self.topics) > 1 and is_there, self.since_ns


class VehicleLane:
    """Vehicle end of the lanes of all stations. `send` is thread-safe.

    Args:
        port: UDP port; another one is used when it is taken.
        deliver: called with (topic, message) of what stations send, in the receiving thread; must
            return soon.
    """

    def __init__(self, port: int, deliver: Deliver, host: str = EVERYWHERE) -> None:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = _bound(family, host, port)
        self._deliver = deliver
        self._changing = threading.Lock()
        self._lanes: dict[int, _Lane] = {}  # by key id; replaced, never changed
        self.refused = Refused()
        self._socket.start(self._handle)

    @property
    def port(self) -> int:
        return self._socket.port

    @property
    def stations(self) -> int:
        """Return the number of stations that are being sent to."""
        oldest_ns = clock.monotonic_ns() - PATIENCE_NS
        return sum(_listens(lane, oldest_ns) for lane in self._lanes.values())

    def grant(self, instance: int, topics: tuple[str, ...] = TO_VEHICLE) -> LaneResponse:
        """Answer the service `lane` with new keys for a station.

        The station's present keys stay valid until it uses the new ones, as the answer may be lost.

        Args:
            topics: topics that the station may send.
        """
        to_station, to_vehicle = os.urandom(KEY_SIZE), os.urandom(KEY_SIZE)
        opener = Opener(to_vehicle, topics, self.refused)
        with self._changing:
            key_id = 0
            while key_id == 0 or key_id in self._lanes:
                key_id = int.from_bytes(os.urandom(4), "little")
            sealer = Sealer(key_id, to_station)
            lane = _Lane(instance, topics, key_id, sealer, opener, clock.monotonic_ns())
            self._lanes = _with(self._lanes, lane)
        return new(
            "quadlab_msgs/srv/Lane_Response",
            accepted=True,
            port=self.port,
            key_id=key_id,
            key_to_station=list(to_station),
            key_to_vehicle=list(to_vehicle),
        )

    def send(self, topic: str, message: Received) -> bool:
        """Send to all listening stations without waiting; return whether there is one."""
        if len(message.payload) > LARGEST_PAYLOAD:
            return False
        oldest_ns = clock.monotonic_ns() - PATIENCE_NS
        listening = [lane for lane in self._lanes.values() if _listens(lane, oldest_ns)]
        for lane in listening:
            self._socket.send(lane.sealer.seal(topic, message), lane.address)
        return bool(listening)

    def close(self) -> None:
        self._socket.close()

    def _handle(self, datagram: bytes, address: Address) -> None:
        key_id = key_id_of(datagram)
        lane = None if key_id is None else self._lanes.get(key_id)
        if lane is None:
            self.refused.foreign += 1
            return
        newest = lane.opener.newest
        opened = lane.opener.open(datagram)
        if opened is None:
            return
        if lane.address is None:
            self._forget_others(lane)
        if lane.opener.newest > newest:  # an overtaken one may be from a previous address
            lane.address = address
        lane.since_ns = clock.monotonic_ns()
        topic, received = opened
        if topic != HELLO:
            self._deliver(topic, received)

    def _forget_others(self, lane: _Lane) -> None:
        """Forget the station's other keys once it uses the new ones."""
        with self._changing:
            self._lanes = {
                key_id: one
                for key_id, one in self._lanes.items()
                if one is lane or one.station != lane.station
            }


def _listens(lane: _Lane, oldest_ns: int) -> bool:
    return lane.address is not None and lane.since_ns >= oldest_ns


def _with(lanes: dict[int, _Lane], lane: _Lane) -> dict[int, _Lane]:
    """Return the lanes with one more, limited to MAX_STATIONS; each station keeps the lanes in use
    and the newest.
    """
    kept = [one for one in lanes.values() if one.station != lane.station or one.address]
    kept.append(lane)
    kept.sort(key=lambda one: one.rank)
    stations = list(dict.fromkeys(one.station for one in reversed(kept)))[:MAX_STATIONS]
    return {one.key_id: one for one in kept if one.station in stations}


def _bound(family: int, host: str, port: int) -> LaneSocket:
    if 0 < port < 65536:
        with contextlib.suppress(OSError):
            return LaneSocket(family, host, port)
    return LaneSocket(family, host, 0)
