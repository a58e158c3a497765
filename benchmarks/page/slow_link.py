"""A relay that carries the connections of a browser as a slow link does: all share one rate.

Its buffers are small, so that who sends more than it carries has to wait, as behind a radio.
Chromium's own emulation of slow networks takes a websocket at full rate and keeps what it delays.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager

PIECE = 1400
"""Bytes that are carried at once."""
BUFFER = 8192
"""Bytes of each socket's receive buffer, and of the relay's own."""


class _Direction:
    """One direction of the link, which carries one piece after another."""

    def __init__(self, rate: float, delay: float) -> None:
        self.rate, self._delay = rate, delay
        self._turn = asyncio.Lock()
        self.carried = 0

    async def pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError):
            while piece := await reader.read(PIECE):
                async with self._turn:
                    await asyncio.sleep(len(piece) / self.rate)
                self.carried += len(piece)
                asyncio.get_running_loop().call_later(self._delay, writer.write, piece)
                await writer.drain()
            await asyncio.sleep(2.0 * self._delay)
        writer.close()


class SlowLink:
    """The running relay.

    Attributes:
        port: where it listens on loopback.
    """

    def __init__(self, to: int, rate: float, delay: float) -> None:
        self._to, self._down, self._up = to, _Direction(rate, delay), _Direction(rate, delay)
        self._ready = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()), daemon=True)
        self._thread.start()
        self._ready.wait()

    @property
    def received(self) -> int:
        """Return the bytes that the browser got."""
        return self._down.carried

    def change(self, rate: float) -> None:
        """Carry so many bytes a second from now on."""
        self._down.rate = self._up.rate = rate

    def close(self) -> None:
        self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join()

    async def _run(self) -> None:
        self._loop, self._ended = asyncio.get_running_loop(), asyncio.Event()
        server = await asyncio.start_server(self._serve, "127.0.0.1", 0, limit=BUFFER)
        self.port: int = server.sockets[0].getsockname()[1]
        self._ready.set()
        await self._ended.wait()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        upstream = socket.socket()
        upstream.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        upstream.setblocking(False)
        await self._loop.sock_connect(upstream, ("127.0.0.1", self._to))
        its, theirs = await asyncio.open_connection(sock=upstream, limit=BUFFER)
        with contextlib.suppress(asyncio.CancelledError):  # the link is taken away
            await asyncio.gather(self._up.pump(reader, theirs), self._down.pump(its, writer))


@contextmanager
def slow_link(to: int, rate: float, delay: float = 0.02) -> Iterator[SlowLink]:
    """Yield a relay to a port of this machine.

    Args:
        rate: bytes a second in each direction.
        delay: s in each direction.
    """
    link = SlowLink(to, rate, delay)
    try:
        yield link
    finally:
        link.close()
