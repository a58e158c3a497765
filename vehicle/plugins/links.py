"""Links to a plugin: a process of its own, or a program that answers over UDP."""

from __future__ import annotations

import socket
import time
from contextlib import suppress
from ipaddress import IPv4Address
from pathlib import Path
from typing import Protocol

from quadrotor.errors import QuadlabError, RefusedError
from vehicle.plugins.contract import Contract
from vehicle.plugins.host import FAILED, LONGEST, READY, serve
from vehicle_link.jobs import Job

UDP = "udp"
"""Name of the law, and of the estimator, that is a program which answers over UDP."""
PATIENCE, START = 1.0, 10.0
"""s of waiting for an answer, and for the first word of a process, where simulated time waits."""
LARGEST = 4096
HERE = "127.0.0.1"


class Link(Protocol):
    """Both ways of one plugin."""

    def ready(self) -> bool:
        """Return whether inputs may be sent."""
        ...

    def send(self, data: bytes) -> None:
        """Send an input; one that finds no room is lost."""
        ...

    def receive(self) -> bytes | None:
        """Return the next answer, None when none came. Raises RefusedError when none will."""
        ...

    def close(self) -> None: ...


class NoLink:
    """Stands for a link that could not be made; `why` is told when it is first used."""

    def __init__(self, why: str) -> None:
        self._why = why

    def ready(self) -> bool:
        raise RefusedError(self._why)

    def send(self, data: bytes) -> None: ...

    def receive(self) -> bytes | None:
        raise RefusedError(self._why)

    def close(self) -> None: ...


class ProcessLink:
    """A plugin of a file or package, in a process of its own.

    Args:
        contract, source: as `vehicle.plugins.host.load` takes them.
        waits: whether time waits for an answer, as in simulated flights.

    Raises JobError when the process cannot be started.
    """

    def __init__(self, contract: Contract, source: str, waits: bool) -> None:
        self._name, self._waits, self._ready = Path(source).name, waits, False
        self._size = contract.outputs.itemsize
        # Keeps the boundaries of messages, and tells at once when the other end is gone.
        self._socket, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with other:
            there = other.fileno()
            self._job: Job[None] = Job(
                serve, there, contract, source, niceness=0, keep=(there,), longest=LONGEST
            )
        self._socket.settimeout(START if waits else 0.0)

    def ready(self) -> bool:
        if not self._ready:
            self._ready = self.receive() == READY
            if self._ready and self._waits:
                self._socket.settimeout(PATIENCE)
        return self._ready

    def send(self, data: bytes) -> None:
        with suppress(OSError):  # full: counted as missed; gone: told by `receive`
            self._socket.send(data)

    def receive(self) -> bytes | None:
        try:
            data = self._socket.recv(LARGEST)
        except (BlockingIOError, TimeoutError):
            self._job.poll()  # takes what the plugin prints, so that it never waits for a reader
            return None
        except OSError:
            data = b""
        if not data:
            raise RefusedError(self._end())
        if data.startswith(FAILED) and len(data) > self._size:
            raise RefusedError(data.removeprefix(FAILED).decode(errors="replace").strip())
        return data

    def close(self) -> None:
        self._socket.close()
        self._job.abandon()

    def _end(self) -> str:
        end = time.monotonic() + (PATIENCE if self._waits else 0.0)
        while not self._job.poll(0.01 if self._waits else 0.0):
            if time.monotonic() >= end:
                return f"{self._name}: its process closed the connection"
        try:
            self._job.result()
        except QuadlabError as error:
            return str(error)
        return f"{self._name}: its process ended"


class UdpLink:
    """A program that receives inputs at `peer` and answers to our `port`.

    Args:
        contract: of its answers. group: of the two parameters that peer and port are.
        peer: "ADDRESS:PORT", IPv4. port: ours. waits: as of `ProcessLink`.

    Raises RefusedError for an address that cannot be used.
    """

    def __init__(self, contract: Contract, group: str, peer: str, port: int, waits: bool) -> None:
        self._outputs = contract.outputs
        host, _, number = peer.rpartition(":")
        try:
            # Numbers alone: to look a name up may take seconds, which no tick has.
            address = (str(IPv4Address(host)), int(number))
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.bind((HERE if IPv4Address(host).is_loopback else "", port))
            self._socket.connect(address)  # packets from elsewhere are not received from now on
            self._drop_received()
        except (OSError, ValueError, OverflowError) as error:
            raise RefusedError(
                f"{group}.udp_peer = {peer!r} with udp_port = {port} cannot be used "
                f"({error}); give ADDRESS:PORT of the program, as 127.0.0.1:9101, and a free port"
            ) from None
        self._socket.settimeout(PATIENCE if waits else 0.0)

    def _drop_received(self) -> None:
        """Drop what came from anywhere before the socket was connected."""
        self._socket.setblocking(False)
        with suppress(OSError):
            while True:
                self._socket.recv(LARGEST)

    def ready(self) -> bool:
        return True

    def send(self, data: bytes) -> None:
        with suppress(OSError):  # nobody listens there: counted as missed
            self._socket.send(data)

    def receive(self) -> bytes | None:
        try:
            data = self._socket.recv(LARGEST)
        except OSError:  # nothing came, or the computer there says that nobody listens
            return None
        if len(data) != (size := self._outputs.itemsize):
            raise RefusedError(
                f"a packet of {len(data)} bytes came, expected {size}: {size // 8} doubles, "
                f"{', '.join(self._outputs.names or ())}"
            )
        return data

    def close(self) -> None:
        self._socket.close()


def udp_link(contract: Contract, group: str, peer: str, port: int, waits: bool) -> Link:
    """Return a UdpLink; with an address that cannot be used, one that has failed already."""
    try:
        return UdpLink(contract, group, peer, port, waits)
    except QuadlabError as error:
        return NoLink(str(error))
