"""The vehicle's end: one UDP socket, a lane for each station that asked for one."""

from __future__ import annotations

import contextlib
import os
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from vehicle_link import clock
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
from vehicle_link.messages import Message, new
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.publisher import Received

MOST = 8
"""Stations; one more takes the place of the one not heard for the longest, of those that only hear
first."""
PATIENCE_NS = 2_000_000_000
"""A station is sent to for so long after its last datagram. Longer than most breaks of a radio:
then data flow again with the first packet that gets through, not with the station's next hello."""
GONE_NS = 60_000_000_000
"""A station that may send has its place for so long, whoever else asks for one."""

Deliver = Callable[[str, Received], None]


@dataclass
class _Lane:
    instance: int  # of the station's process, as it says
    topics: tuple[str, ...]  # it may send
    key_id: int
    sealer: Sealer = field(repr=False)
    opener: Opener = field(repr=False)
    since_ns: int  # granted, or received last
    address: Address = None  # None until the first datagram

    @property
    def station(self) -> tuple[int, tuple[str, ...]]:
        """Return the instance and topics: an instance is no secret, and a station that may only
        receive cannot pass for one that may send.
        """
        return self.instance, self.topics

    @property
    def rank(self) -> tuple[bool, int]:
        """Return the order of lanes: stations that may send and are present come first, then the
        one received from last.
        """
        is_there = clock.monotonic_ns() - self.since_ns < GONE_NS
        return len(self.topics) > 1 and is_there, self.since_ns


class VehicleLane:
    """`put` is for any thread; `deliver` is called in the one that receives.

    Args:
        port: UDP; another when it is taken.
        deliver: (topic, message) of what stations send; must return soon.
    """

    def __init__(self, port: int, deliver: Deliver, host: str = "0.0.0.0") -> None:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = _bound(family, host, port)
        self._deliver = deliver
        self._changing = threading.Lock()
        self._lanes: dict[int, _Lane] = {}  # by id of keys; replaced, never changed
        self.refused = Refused()
        self._socket.start(self._take)

    @property
    def port(self) -> int:
        return self._socket.port

    @property
    def stations(self) -> int:
        """Return the number of stations that are sent to."""
        oldest_ns = clock.monotonic_ns() - PATIENCE_NS
        return sum(_listens(lane, oldest_ns) for lane in self._lanes.values())

    def grant(self, instance: int, topics: tuple[str, ...] = TO_VEHICLE) -> Message:
        """Answer the service `lane`: new keys for a station, each time.

        Keys it has already stay good until it uses the new ones: the answer may be lost.

        Args:
            topics: what it may send.
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
            f"{SERVICES['lane']}_Response",
            accepted=True,
            port=self.port,
            key_id=key_id,
            key_to_station=list(to_station),
            key_to_vehicle=list(to_vehicle),
        )

    def put(self, topic: str, message: Received) -> bool:
        """Send to all stations that listen, without waiting, and return whether there is one."""
        if len(message.payload) > LARGEST_PAYLOAD:
            return False
        oldest_ns = clock.monotonic_ns() - PATIENCE_NS
        listening = [lane for lane in self._lanes.values() if _listens(lane, oldest_ns)]
        for lane in listening:
            self._socket.send(lane.sealer.seal(topic, message), lane.address)
        return bool(listening)

    def close(self) -> None:
        self._socket.close()

    def _take(self, datagram: bytes, address: Address) -> None:
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
        if lane.opener.newest > newest:  # one that was overtaken may be from where it was before
            lane.address = address
        lane.since_ns = clock.monotonic_ns()
        topic, received = opened
        if topic != HELLO:
            self._deliver(topic, received)

    def _forget_others(self, lane: _Lane) -> None:
        """Forget the other keys, as the station uses its new ones."""
        with self._changing:
            self._lanes = {
                key_id: one
                for key_id, one in self._lanes.items()
                if one is lane or one.station != lane.station
            }


def _listens(lane: _Lane, oldest_ns: int) -> bool:
    return lane.address is not None and lane.since_ns >= oldest_ns


def _with(lanes: dict[int, _Lane], lane: _Lane) -> dict[int, _Lane]:
    """Return the lanes with one more; of each station only what it uses and what it was given last,
    of MOST stations.
    """
    kept = [one for one in lanes.values() if one.station != lane.station or one.address]
    kept.append(lane)
    kept.sort(key=lambda one: one.rank)
    stations = list(dict.fromkeys(one.station for one in reversed(kept)))[:MOST]
    return {one.key_id: one for one in kept if one.station in stations}


def _bound(family: int, host: str, port: int) -> LaneSocket:
    if 0 < port < 65536:
        with contextlib.suppress(OSError):
            return LaneSocket(family, host, port)
    return LaneSocket(family, host, 0)
