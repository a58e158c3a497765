"""Station end of the lane to one vehicle: requests it, says hello, tracks whether it is up."""

from __future__ import annotations

import ipaddress
import logging
import math
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from quadrotor.errors import LinkError
from vehicle_link import clock
from vehicle_link.addresses import EVERYWHERE
from vehicle_link.lane.datagram import (
    A_HELLO,
    HELLO,
    KEY_SIZE,
    LARGEST_PAYLOAD,
    TO_STATION,
    Opener,
    Refused,
    Sealer,
    key_id_of,
)
from vehicle_link.lane.lane_socket import Address, LaneSocket
from vehicle_link.messages.records import LaneResponse
from vehicle_link.transport.publisher import Received

log = logging.getLogger(__name__)

HELLO_PERIOD = 0.1  # s
SILENT_AFTER = 0.5  # s; a lane that was up counts as down after this
ASK_AGAIN, ASK_AGAIN_MOST = 1.0, 10.0
"""Shortest and longest pause, in s, between two requests while the lane stays silent; each pause is
twice the one before. If the path blocks datagrams, asking more often does not help."""


@dataclass(frozen=True)
class _Keys:
    vehicle: int  # the instance that issued them
    key_id: int
    address: Address
    sealer: Sealer = field(repr=False)
    opener: Opener = field(repr=False)


class StationLane:
    """Station end of the lane to one vehicle. `send` and `note_vehicle` are thread-safe.

    Args:
        host: host name or address of the vehicle.
        ask: calls the vehicle's service `lane`, in a separate thread. Raises LinkError.
        deliver: called with (topic, message) of what the vehicle sends, in the receiving thread.
        changed: called with whether the lane is up when that changes, in a thread of this lane.
    """

    def __init__(
        self,
        host: str,
        ask: Callable[[], LaneResponse],
        deliver: Callable[[str, Received], None],
        changed: Callable[[bool], None] = lambda is_up: None,
    ) -> None:
        self._host, self._ask = host, ask
        self._deliver, self._changed = deliver, changed
        self._socket: LaneSocket | None = None
        self._keys: _Keys | None = None
        self.refused = Refused()
        self._received_at: float | None = None
        self._vehicle, self._vehicle_received_at = 0, -math.inf
        self._asking = False
        self._asked, self._pause = -math.inf, ASK_AGAIN
        self._greeted = -math.inf
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="lane keeper", daemon=True)
        self._thread.start()

    @property
    def is_up(self) -> bool:
        """Return whether data arrive from the vehicle by this lane."""
        received_at = self._received_at
        return received_at is not None and clock.monotonic() - received_at < SILENT_AFTER

    def note_vehicle(self, instance: int) -> None:
        """Note the vehicle's instance, received over the link, hence that it can be asked."""
        self._vehicle, self._vehicle_received_at = instance, clock.monotonic()

    def send(self, topic: str, message: Received, *, greets: bool = False) -> bool:
        """Send without waiting; return whether it was sent, whether or not the lane is up.

        Args:
            greets: whether the vehicle treats this message as a hello, which then need not be sent.
        """
        if greets:
            self._greeted = time.monotonic()
        keys, link = self._keys, self._socket
        if keys is None or link is None or len(message.payload) > LARGEST_PAYLOAD:
            return False
        return link.send(keys.sealer.seal(topic, message), keys.address)

    def close(self) -> None:
        self._closing.set()
        self._thread.join(1.0)
        if self._socket is not None:
            self._socket.close()

    def _run(self) -> None:
        was_up = False
        while not self._closing.wait(HELLO_PERIOD):
            if time.monotonic() - self._greeted >= HELLO_PERIOD:
                self.send(HELLO, A_HELLO)
            if self.is_up != was_up:
                was_up = not was_up
                self._report_change(was_up)
            if was_up:
                self._pause = ASK_AGAIN
            if self._should_ask(was_up):
                self._asking = True
                # In a thread: an answer may take a second, and hellos must continue.
                threading.Thread(target=self._get_keys, name="lane keys", daemon=True).start()

    def _should_ask(self, is_up: bool) -> bool:
        now, keys = clock.monotonic(), self._keys
        if self._asking or now - self._vehicle_received_at > SILENT_AFTER:
            return False
        if keys is not None and keys.vehicle != self._vehicle:  # another process: ask at once
            return now - self._asked >= HELLO_PERIOD
        return not is_up and now - self._asked >= self._pause

    def _get_keys(self) -> None:
        vehicle = self._vehicle
        if not math.isinf(self._asked):
            self._pause = min(2 * self._pause, ASK_AGAIN_MOST)
        try:
            self._use(vehicle, self._ask())
        except (LinkError, OSError) as error:
            log.info("no lane to %s: %s", self._host, error)
        finally:
            self._asked = clock.monotonic()
            self._asking = False

    def _use(self, vehicle: int, answer: LaneResponse) -> None:
        """Use the keys of this answer. Raises LinkError or OSError, and then keeps the old keys."""
        if not answer.accepted:
            raise LinkError(f"the vehicle gives no lane: {answer.reason}")
        to_station, to_vehicle = bytes(answer.key_to_station), bytes(answer.key_to_vehicle)
        if not len(to_station) == len(to_vehicle) == KEY_SIZE or to_station == to_vehicle:
            raise LinkError(f"the vehicle's keys of {len(to_station)} and {len(to_vehicle)} B")
        found = socket.getaddrinfo(self._host, int(answer.port), type=socket.SOCK_DGRAM)
        family, _, _, _, address = found[0]
        if self._socket is None:
            self._socket = LaneSocket(family, _own_address(str(address[0])), 0)
            self._socket.start(self._handle)
        key_id = int(answer.key_id)
        sealer = Sealer(key_id, to_vehicle)
        opener = Opener(to_station, TO_STATION, self.refused)
        self._keys = _Keys(vehicle, key_id, address, sealer, opener)
        self.send(HELLO, A_HELLO)

    def _handle(self, datagram: bytes, _: Address) -> None:
        keys = self._keys
        if keys is None or key_id_of(datagram) != keys.key_id:
            self.refused.foreign += 1
            return
        opened = keys.opener.open(datagram)
        if opened is not None:
            self._received_at = clock.monotonic()
            self._deliver(*opened)

    def _report_change(self, is_up: bool) -> None:
        try:
            self._changed(is_up)
        except LinkError as error:  # the session is closing
            log.info("lane of %s: %s", self._host, error)


def _own_address(vehicle: str) -> str:
    """Return the address to bind for a vehicle at this address: the same on this computer."""
    found = ipaddress.ip_address(vehicle.partition("%")[0])
    if found.is_loopback:
        return vehicle
    return "::" if found.version == 6 else EVERYWHERE
