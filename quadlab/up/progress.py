"""The start of `quadlab up`: ports that must be free, and lines until the page answers."""

from __future__ import annotations

import socket
import threading
import time

from quadrotor.errors import UsageError

PROGRESS_PERIOD = 1.5
"""Seconds between two lines while the processes start."""


class Progress:
    """Reporter of the start's progress until the page answers."""

    def __init__(self, host: str, port: int) -> None:
        self._address = host, port
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._tell, daemon=True)

    def __enter__(self) -> Progress:
        print("quadlab: starting simulator, vehicle, station and page", flush=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()

    def _tell(self) -> None:
        began = time.monotonic()
        page: socket.socket | None = None
        while not self._ended.is_set():
            try:
                if page is None:
                    page = socket.create_connection(self._address, PROGRESS_PERIOD)
                    page.sendall(b"GET / HTTP/1.0\r\n\r\n")
                page.recv(1)  # any answer counts: with TLS it may only close
                page.close()
                return
            except TimeoutError:  # it listens, and will answer once it runs
                pass
            except OSError:
                self._ended.wait(PROGRESS_PERIOD)
            print(f"quadlab: starting, {time.monotonic() - began:.0f} s", flush=True)


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
