"""The start of `quadlab up`: ports that must be free, and lines until the page answers."""

from __future__ import annotations

import socket
import time

from quadrotor.errors import UsageError

PROGRESS_PERIOD = 1.5
"""Seconds between two lines while the processes start."""
CONNECTION_PATIENCE = 0.1
"""Seconds; a connection within a computer is made, or refused, at once."""


class Progress:
    """Lines about the start, until the page answers; `report`, called often, never waits."""

    def __init__(self, host: str, port: int) -> None:
        self.is_over = False
        self._address = host, port
        self._began = self._reported = time.monotonic()
        self._page: socket.socket | None = None
        print("quadlab: starting simulator, vehicle, station and page", flush=True)

    def report(self) -> None:
        """Print a line if one is due."""
        if self.is_over:
            return
        self.is_over, now = self._answers(), time.monotonic()
        if not self.is_over and now - self._reported >= PROGRESS_PERIOD:
            self._reported = now
            print(f"quadlab: starting, {now - self._began:.0f} s", flush=True)

    def _answers(self) -> bool:
        try:
            if self._page is None:
                self._page = socket.create_connection(self._address, CONNECTION_PATIENCE)
                self._page.sendall(b"GET / HTTP/1.0\r\n\r\n")
                self._page.setblocking(False)
            self._page.recv(1)  # any answer counts: with TLS it may only close
        except BlockingIOError:  # it listens, and will answer once it runs
            return False
        except OSError:
            self._page = None
            return False
        self._page.close()
        return True


def require_free(
    what: str, port: int, kind: socket.SocketKind, option: str, host: str = "127.0.0.1"
) -> None:
    """Check that `port` of `what` is free. Raises UsageError, which names `option`."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, kind) as probe:
        if kind == socket.SOCK_STREAM:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise UsageError(
                f"port {port} of the {what} cannot be used ({error.strerror}); "
                f"stop what uses it or choose another with {option}"
            ) from None
