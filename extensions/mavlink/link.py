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
from dataclasses import dataclass

from extensions.mavlink.dialect import MAVLink_message
from extensions.mavlink.peer import BYTES_A_SECOND, GONE, SYSTEM, Address, Peer
from quadrotor.errors import LinkError, UsageError

MOST = 8
"""Most ground stations at a time."""
READ_MOST = 64
"""Datagrams read from a socket before the vehicle's telemetry has its turn again."""
UDP_IN, UDP_OUT, TCP_IN = KINDS = ("udpin", "udpout", "tcpin")


@dataclass(frozen=True, slots=True)
class Endpoint:
    """An address to listen on or, with UDP_OUT, to send to."""

    kind: str
    host: str
    port: int


def parse_endpoint(word: str) -> Endpoint:
    """Return the endpoint of udpin:ADDRESS:PORT or tcpin:… (listen), or udpout:ADDRESS:PORT (send
    to). Raises UsageError.
    """
    kind, _, place = word.partition(":")
    host, _, port = place.removeprefix("//").rpartition(":")
    try:
        address = ipaddress.IPv4Address("127.0.0.1" if host == "localhost" else host)
        if kind not in KINDS or not 1 <= int(port) <= 65535:
            raise ValueError
    except ValueError:
        raise UsageError(
            f"{word!r} is not a connection; give udpin:ADDRESS:PORT or tcpin:ADDRESS:PORT to "
            "listen there, or udpout:ADDRESS:PORT to send there, like udpin:127.0.0.1:14550"
        ) from None
    return Endpoint(kind, str(address), int(port))


def is_open(endpoints: Sequence[Endpoint]) -> bool:
    """Return whether other programs than those named can send to an endpoint."""
    return any(one.kind != UDP_OUT for one in endpoints)


def check_reach(endpoints: Sequence[Endpoint], is_protected: bool) -> None:
    """Raise UsageError for an endpoint beyond this computer, unless `is_protected`."""
    for one in endpoints:
        if not (is_protected or ipaddress.ip_address(one.host).is_loopback):
            raise UsageError(
                f"{one.host} is not this computer, and MAVLink has no sign-in: anybody in the "
                "network could fly; give --passphrase FILE to accept signed messages alone, or "
                "--unsigned in a network that is yours"
            )


class Link:
    """All sockets of the gateway. Raises LinkError when a port is in use.

    Args:
        passphrase: of signed messages; "" accepts all.
        unsigned: whether everybody who reaches a port that is listened on may command unsigned.
        say: prints a line.
        has_left: called with a ground station that has fallen silent.
    """

    def __init__(
        self,
        endpoints: Sequence[Endpoint],
        passphrase: str,
        say: Callable[[str], None],
        has_left: Callable[[Peer], None],
        *,
        unsigned: bool,
    ) -> None:
        self._unsigned = unsigned
        self._key = hashlib.sha256(passphrase.encode()).digest() if passphrase else b""
        self._say, self._has_left = say, has_left
        self._timestamps: dict[object, int] = {}  # of signatures, by stream
        self._peers: dict[tuple[int, Address], Peer] = {}
        self._sockets: list[socket.socket] = []
        self._doors: list[socket.socket] = []  # those that accept connections
        for one in endpoints:
            self._open(one)
        # Its own budget is that of all addresses from which nothing valid has come yet.
        datagrams = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._stranger = Peer(datagrams, ("", 0), self._key, False)

    def _open(self, one: Endpoint) -> None:
        is_stream = one.kind == TCP_IN
        kind = socket.SOCK_STREAM if is_stream else socket.SOCK_DGRAM
        sock = socket.socket(socket.AF_INET, kind)
        sock.setblocking(False)
        (self._doors if is_stream else self._sockets).append(sock)
        address = (one.host, one.port)
        if one.kind == UDP_OUT:
            sock.connect(address)  # the kernel then drops what others send here
            self._add(sock, address, is_fixed=True)
            return
        try:
            if is_stream:  # or the port could not be used again for a minute
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            sock.bind(address)
            if is_stream:
                sock.listen(MOST)
        except OSError as error:
            self.close()
            protocol = "TCP" if is_stream else "UDP"
            raise LinkError(
                f"{protocol} port {one.port} of {one.host} cannot be listened on "
                f"({error.strerror}); end the other program, or choose another port"
            ) from None

    @property
    def peers(self) -> list[Peer]:
        return list(self._peers.values())

    def receive(self, timeout: float) -> Iterator[tuple[Peer, MAVLink_message]]:
        """Yield (ground station, message) of what has arrived; wait at most `timeout` s for it."""
        ready, _, _ = select.select([*self._sockets, *self._doors], [], [], timeout)
        for sock in ready:
            if sock in self._doors:
                self._accept(sock)
                continue
            if sock.type == socket.SOCK_STREAM:
                yield from self._read(sock)
                continue
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
        for peer in self.peers:
            if (peer.system or peer.is_stream) and now - peer.heard > GONE:
                self._forget(peer)

    def close(self) -> None:
        for sock in (*self._sockets, *self._doors):
            sock.close()
        self._stranger.socket.close()

    def _forget(self, peer: Peer) -> None:
        del self._peers[peer.socket.fileno(), peer.address]
        if peer.system:
            self.complain(self._stranger, f"{peer.name} left", f"{peer.name} has left")
            self._has_left(peer)
        if peer.is_stream:
            self._sockets.remove(peer.socket)
            peer.socket.close()
        elif peer.is_fixed:
            self._add(peer.socket, peer.address, is_fixed=True)

    def _accept(self, door: socket.socket) -> None:
        try:
            sock, address = door.accept()
        except OSError:  # it has gone already
            return
        if len(self._peers) >= MOST:
            line = f"{address[0]}:{address[1]} is one ground station too many; {MOST} are served"
            self.complain(self._stranger, "many", line)
            sock.close()
            return
        sock.setblocking(False)
        self._sockets.append(sock)
        self._add(sock, address)

    def _read(self, sock: socket.socket) -> Iterator[tuple[Peer, MAVLink_message]]:
        """Yield what one connection sent, at most what it may send in a turn."""
        peer = next(one for one in self._peers.values() if one.socket is sock)
        try:
            data = sock.recv(2048)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            yield from self._taken(sock, peer.address, data)
        else:
            self._forget(peer)

    def _add(self, sock: socket.socket, address: Address, *, is_fixed: bool = False) -> Peer:
        peer = Peer(sock, address, self._key, is_fixed)
        peer.may_command = peer.may_command or self._unsigned
        peer.mav.signing.stream_timestamps = self._timestamps
        self._peers[sock.fileno(), address] = peer
        return peer

    def _taken(
        self, sock: socket.socket, address: Address, data: bytes
    ) -> Iterator[tuple[Peer, MAVLink_message]]:
        now = time.monotonic()
        known = self._peers.get((sock.fileno(), address))
        peer = known or self._stranger
        at = f"{address[0]}:{address[1]}"
        if not peer.may_parse(len(data), now):
            line = f"{at} sends more than {BYTES_A_SECOND // 1000} kB/s; the rest is dropped"
            self.complain(peer, "flood", line)
            return
        if data and not peer.begins(data):
            line = (
                f"{at} does not begin as MAVLink does (0xfe or 0xfd) but with {data[:16]!r}; it is "
                f"{'closed' if peer.is_stream else 'dropped'}"
            )
            self.complain(self._stranger, "BAD_DATA", line)
            if peer.is_stream:
                self._forget(peer)
            return
        for message in peer.parse(data):
            kind, system = message.get_type(), message.get_srcSystem()
            if kind == "BAD_DATA":
                self.complain(peer, kind, f"{at} sends invalid messages: {message.reason}")
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
                self.complain(self._stranger, peer.name, f"{peer.name} is there")
            if peer.system != system:
                line = f"{at} is system {peer.system}; messages of system {system} are dropped"
                self.complain(peer, "system", line)
                continue
            peer.heard = now
            yield peer, message

    def complain(self, peer: Peer, kind: str, line: str) -> None:
        """Print a line about a ground station; lines of one kind are printed once a minute."""
        if peer.is_new(kind, time.monotonic()):
            self._say(line)
