"""Foxglove's own client, run by node, against a site."""

from __future__ import annotations

import json
import queue
import subprocess
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.web.conftest import admin, operator, site, station, until, viewer

__all__ = ["admin", "operator", "site", "station", "until", "viewer"]
ROOT = Path(__file__).parents[3]
CLIENT = Path(__file__).with_name("client.js")
PATIENCE = 20.0  # s: a bound, not an expectation


class Client:
    """One client; its events arrive in order."""

    def __init__(self, node_path: str, url: str, subprotocol: str) -> None:
        self._process = subprocess.Popen(
            [node_path, CLIENT, url, subprotocol],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
        )
        self._events: queue.SimpleQueue[tuple[str, Any]] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def do(self, name: str, *arguments: Any) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps([name, *arguments]) + "\n")
        self._process.stdin.flush()

    def event(self, name: str) -> Any:
        """Return the content of the next event of this name, skipping others."""
        while True:
            came, content = self._events.get(timeout=PATIENCE)
            if came == name:
                return content

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        self._thread.join()
        for stream in (self._process.stdin, self._process.stdout):
            assert stream is not None
            stream.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            name, content = json.loads(line)
            self._events.put((name, content))


@pytest.fixture
def connect(node_path: str) -> Iterator[Callable[..., Client]]:
    """Yield `connect(person)`: a client that signed in by a link which that browser made."""
    made: list[Client] = []

    def connected(person: httpx.Client, subprotocol: str = "foxglove.websocket.v1") -> Client:
        url = person.post("/api/foxglove/link").json()["url"]
        made.append(Client(node_path, url, subprotocol))
        return made[-1]

    yield connected
    for client in made:
        client.close()
