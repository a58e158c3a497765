"""The lines that `quadlab up` prints until the page answers."""

from __future__ import annotations

import socket
import threading
import time

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
