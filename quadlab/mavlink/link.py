"""The sockets of the gateway, and the ground stations behind them.

Work is bounded: at most MOST ground stations are known, of each so many bytes a second are parsed
that a person's program never notices, and what is beyond is dropped before it is looked at.
"""

from __future__ import annotations

import hashlib
import ipaddress
import select
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from quadlab.mavlink.dialect import mavlink
from quadrotor.errors import LinkError, UsageError

SYSTEM, COMPONENT = 1, 1
MOST = 8
"""Most ground stations at a time."""
BYTES_A_SECOND = 60_000
"""Bytes parsed of one ground station in a second; also the longest burst."""
AT_LEAST = 40
"""Bytes that a datagram counts at least."""
READ_MOST = 64
"""Datagrams read from a socket before the vehicle's telemetry has its turn again."""
GONE = 5.0
"""Seconds of silence after which a ground station has left."""
SAID_AGAIN = 60.0
"""Seconds after which the same complaint about a ground station is printed again."""
SAID_MOST = 100
TENS_OF_MICROSECONDS, SIGNING_EPOCH = 100_000, 1_420_070_400  # 1 January 2015

Address = tuple[str, int]


@dataclass(frozen=True, slots=True)
class Endpoint:
    """An address to listen on or, with `listens` false, to send to."""

    listens: bool
    host: str
    port: int


def parse_endpoint(word: str) -> Endpoint:
    """Return the endpoint of udpin:ADDRESS:PORT (listen) or udpout:ADDRESS:PORT (send to). Raises
    UsageError.
    """
    kind, _, place = word.partition(":")
    host, _, port = place.removeprefix("//").rpartition(":")
    try:
        address = ipaddress.IPv4Address("127.0.0.1" if host == "localhost" else host)
        if kind not in ("udpin", "udpout") or not 1 <= int(port) <= 65535:
            raise ValueError
    except ValueError:
        raise UsageError(
            f"{word!r} is not a connection; give udpin:ADDRESS:PORT to listen there, or "
            "udpout:ADDRESS:PORT to send there, like udpin:127.0.0.1:14550"
        ) from None
    return Endpoint(kind == "udpin", str(address), int(port))


def check_reach(endpoints: Sequence[Endpoint], is_protected: bool) -> None:
    """Raise UsageError for an endpoint beyond this computer, unless `is_protected`."""
    for one in endpoints:
        if not (is_protected or ipaddress.ip_address(one.host).is_loopback):
            raise UsageError(
                f"{one.host} is not this computer, and MAVLink has no sign-in: anybody in the "
                "network could fly; give --passphrase FILE to accept signed messages alone, or "
                "--unsigned in a network that is yours"
            )


class _Signed(mavlink.MAVLink):  # type: ignore[misc]  # of an untyped package
    """pymavlink's parser, in which a forged signature does not set the time of its stream."""

    def check_signature(self, data: bytearray, system: int, component: int) -> bool:
        times, key = self.signing.stream_timestamps, (data[-13], system, component)
        before = times.get(key)
        if super().check_signature(data, system, component):
            return True
        times.pop(key, None)
        if before is not None:
            times[key] = before
        return False


class Peer:
    """One ground station: an address that sends MAVLink, or to which it is sent.

    Attributes:
        system: source system of its first message, which it keeps; 0 before that.
        heard: when its newest message came, s of the computer's steady clock.
        due: when each message is due that is sent periodically, by its id; `period` in s.
        shown: what its newest heartbeat contained.
        waiting: messages to send as time allows, each sequence to its end.
    """

    def __init__(self, sock: socket.socket, address: Address, key: bytes, is_fixed: bool) -> None:
        self._socket, self.address, self.is_fixed = sock, address, is_fixed
        self.mav = _Signed(self, SYSTEM, COMPONENT)
        self.mav.robust_parsing = True
        if key:
            signing = self.mav.signing
            signing.secret_key, signing.sign_outgoing = key, True
            signing.timestamp = int((time.time() - SIGNING_EPOCH) * TENS_OF_MICROSECONDS)
        self.system, self.heard = 0, -GONE
        self.due: dict[int, float] = {}
        self.shown: Any = None
        self.period: dict[int, float] = {}
        self.waiting: dict[str, Iterator[Any]] = {}
        self._budget, self._filled = float(BYTES_A_SECOND), time.monotonic()
        self._said: dict[str, float] = {}

    @property
    def name(self) -> str:
        """Return the name under which it commands."""
        return f"mavlink {self.system} at {self.address[0]}:{self.address[1]}"

    def send(self, message: Any) -> None:
        """Send a message; it is lost when nobody receives there, as on any datagram link."""
        self.mav.send(message)

    def write(self, data: bytes) -> None:
        """Send bytes, for pymavlink."""
        with suppress(OSError):
            self._socket.sendto(data, self.address)

    def may_parse(self, size: int, now: float) -> bool:
        """Return whether a datagram of `size` bytes is within what it may send."""
        gained = (now - self._filled) * BYTES_A_SECOND
        self._budget, self._filled = min(self._budget + gained, float(BYTES_A_SECOND)), now
        if self._budget < AT_LEAST:
            return False
        self._budget -= max(size, AT_LEAST)
        return True

    def parse(self, data: bytes) -> list[Any]:
        """Return the messages of one datagram; nothing of it is kept for the next one."""
        messages = self.mav.parse_buffer(data) or []
        self.mav.buf, self.mav.buf_index = bytearray(), 0
        return list(messages)

    def is_new(self, kind: str, now: float) -> bool:
        """Return whether a complaint of this kind was not said within the last minute."""
        is_new = now - self._said.get(kind, -SAID_AGAIN) >= SAID_AGAIN
        if is_new:
            if len(self._said) >= SAID_MOST:
                self._said.clear()
            self._said[kind] = now
        return is_new


class Link:
    """All sockets of the gateway. Raises LinkError when a port is in use.

    Args:
        passphrase: of signed messages; "" accepts all.
        say: prints a line.
        has_left: called with a ground station that has fallen silent.
    """

    def __init__(
        self,
        endpoints: Sequence[Endpoint],
        passphrase: str,
        say: Callable[[str], None],
        has_left: Callable[[Peer], None],
    ) -> None:
        self._key = hashlib.sha256(passphrase.encode()).digest() if passphrase else b""
        self._say, self._has_left = say, has_left
        self._timestamps: dict[Any, int] = {}  # of signatures, by stream
        self._peers: dict[tuple[int, Address], Peer] = {}
        self._sockets: list[socket.socket] = []
        for one in endpoints:
            self._open(one)
        # Its own budget is that of all addresses from which nothing valid has come yet.
        self._stranger = Peer(self._sockets[0], ("", 0), self._key, False)

    def _open(self, one: Endpoint) -> None:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.setblocking(False)
        self._sockets.append(sock)
        address = (one.host, one.port)
        if not one.listens:
            sock.connect(address)  # the kernel then drops what others send here
            self._add(sock, address, is_fixed=True)
            return
        try:
            sock.bind(address)
        except OSError as error:
            self.close()
            raise LinkError(
                f"UDP port {one.port} of {one.host} cannot be listened on ({error.strerror}); end "
                "the other program, or choose another port"
            ) from None

    @property
    def peers(self) -> list[Peer]:
        return list(self._peers.values())

    def receive(self, timeout: float) -> Iterator[tuple[Peer, Any]]:
        """Yield (ground station, message) of what has arrived; wait at most `timeout` s for it."""
        ready, _, _ = select.select(self._sockets, [], [], timeout)
        for sock in ready:
            for _ in range(READ_MOST):
                try:
                    data, address = sock.recvfrom(2048)
                except BlockingIOError:
                    break
                except OSError:  # refused: nobody listens at the other end
                    continue
                yield from self._taken(sock, address, data)

    def forget_silent(self) -> None:
        """Forget the ground stations that have left."""
        now = time.monotonic()
        for key, peer in list(self._peers.items()):
            if peer.system and now - peer.heard > GONE:
                self._say(f"{peer.name} has left")
                self._has_left(peer)
                del self._peers[key]
                if peer.is_fixed:
                    self._add(peer._socket, peer.address, is_fixed=True)

    def close(self) -> None:
        for sock in self._sockets:
            sock.close()

    def _add(self, sock: socket.socket, address: Address, *, is_fixed: bool = False) -> Peer:
        peer = Peer(sock, address, self._key, is_fixed)
        peer.mav.signing.stream_timestamps = self._timestamps
        self._peers[sock.fileno(), address] = peer
        return peer

    def _taken(
        self, sock: socket.socket, address: Address, data: bytes
    ) -> Iterator[tuple[Peer, Any]]:
        now = time.monotonic()
        known = self._peers.get((sock.fileno(), address))
        peer = known or self._stranger
        at = f"{address[0]}:{address[1]}"
        if not peer.may_parse(len(data), now):
            line = f"{at} sends more than {BYTES_A_SECOND // 1000} kB/s; the rest is dropped"
            self.complain(peer, "flood", line)
            return
        for message in peer.parse(data):
            kind, system = message.get_type(), message.get_srcSystem()
            if kind == "BAD_DATA":
                self.complain(peer, kind, f"{at} sends what is not valid: {message.reason}")
                continue
            if kind.startswith("UNKNOWN") or system in (0, SYSTEM):
                continue
            if getattr(message, "target_system", 0) not in (0, SYSTEM):
                continue
            if known is None:
                if len(self._peers) >= MOST:
                    line = f"{at} is one ground station too many; {MOST} are served"
                    self.complain(peer, "many", line)
                    return
                known = peer = self._add(sock, address)
            if not peer.system:
                peer.system = system
                self._say(f"{peer.name} is there")
            if peer.system != system:
                line = f"{at} is system {peer.system}; messages of system {system} are dropped"
                self.complain(peer, "system", line)
                continue
            peer.heard = now
            yield peer, message

    def complain(self, peer: Peer, kind: str, line: str) -> None:
        """Print a line about a ground station, those of one kind once a minute."""
        if peer.is_new(kind, time.monotonic()):
            self._say(line)
