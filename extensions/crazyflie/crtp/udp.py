"""CRTP over UDP, one packet a datagram: the client's end, and a server's on loopback."""

from __future__ import annotations

import contextlib
import socket

from extensions.crazyflie.crtp.packets import FrameReader, frame
from quadrotor.errors import LinkError


class UdpPort:
    """The client's end of CRTP over UDP, one packet a datagram; a port that carries frames.

    Raises OSError when the host is not known.
    """

    def __init__(self, host: str, port: int) -> None:
        self.link = f"udp://{host}:{port}"
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._frames = FrameReader()
        self._socket.connect((host, port))

    def read(self) -> bytes:
        packets = []
        # Refused: nobody listens there yet, which its silence tells.
        with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
            while packet := self._socket.recv(64):
                packets.append(frame(packet))
        return b"".join(packets)

    def write(self, data: bytes) -> None:
        for packet in self._frames.feed(data):
            with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
                self._socket.send(packet)

    def fileno(self) -> int:
        return self._socket.fileno()

    def close(self) -> None:
        self._socket.close()


class UdpServer:
    """A server for one client at a time, the one that was heard last; carries frames.

    Args:
        port: 0 takes any.

    Raises LinkError when the port is in use.

    Attributes:
        link: where clients find it.
        dropped: bytes without a client.
    """

    def __init__(self, port: int) -> None:
        self.dropped = 0
        self._frames = FrameReader()
        self._client: tuple[str, int] | None = None
        self._unplugged = False
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind(("127.0.0.1", port))
        except OSError as error:
            self._socket.close()
            raise LinkError(
                f"udp://127.0.0.1:{port} cannot be served: {error.strerror}; "
                "end the other Crazyflie there"
            ) from None
        self.link = f"udp://127.0.0.1:{self._socket.getsockname()[1]}"

    def read(self) -> bytes:
        packets = []
        with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
            while True:
                packet, self._client = self._socket.recvfrom(64)
                if packet:
                    packets.append(frame(packet))
        return b"" if self._unplugged else b"".join(packets)

    def write(self, data: bytes) -> None:
        for packet in self._frames.feed(data):
            if self._client is None or self._unplugged:
                self.dropped += len(packet)
                continue
            with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
                self._socket.sendto(packet, self._client)

    def fileno(self) -> int:
        return self._socket.fileno()

    def unplug(self) -> None:
        """Take the radio out of reach."""
        self._unplugged = True

    def plug_in(self) -> None:
        self._unplugged = False

    def close(self) -> None:
        self._socket.close()
