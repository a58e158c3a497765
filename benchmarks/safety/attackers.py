"""Attacks on the sockets of a running laboratory: noise, mutated messages, torn, huge, slow.

Each attack takes a `Mark` and a seed, and returns how often it was obeyed, which must never be.
"""

from __future__ import annotations

import contextlib
import json
import logging
import random
import socket
import string
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from websockets.exceptions import WebSocketException
from websockets.sync.client import connect
from websockets.typing import Origin

from benchmarks.link.hostile_bytes import chunk
from quadrotor.errors import LinkError
from vehicle_link.transport.loopback import loopback_session

WAIT = 2.0
"""Longest time, in s, to wait for an answer or a place to send to."""
LARGE = 1 << 20
"""Size, in bytes, of what is larger than anything that a door takes."""
SLOW = 1200
"""Connections that send a byte a second."""
SLOWLY = 5
"""Bytes that each of them sends."""
OF_VIEWERS = ("emergency", "fleet/land", "sign_out", "/link", "view/camera", "/login")
"""Parts of the paths by which a viewer may change something, or land."""
ALLOWED = range(200, 300)


@dataclass(frozen=True)
class Mark:
    """The aim of an attack, and its extent.

    Attributes:
        cookie: of a page that is signed in; "" if none is.
        origin: of the page that seems to ask.
        words: valid messages to mutate, or paths: `METHOD /path` or `/path`.
    """

    port: int
    count: int
    host: str = "127.0.0.1"
    cookie: str = ""
    origin: str = ""
    words: Sequence[Any] = ()


Attack = Callable[[Mark, int], int]


def bytes_on_connections(mark: Mark, seed: int) -> int:
    """Send noise and mutated messages on TCP connections, a new one when the other end closes."""
    generator, sent = random.Random(seed), 0
    while sent < mark.count:
        with (
            contextlib.suppress(OSError),
            socket.create_connection((mark.host, mark.port), WAIT) as door,
        ):
            door.settimeout(0.2)
            for _ in range(generator.randrange(1, 40)):
                data = chunk(generator, mark.words)
                sent += len(data)
                door.sendall(data)
            with contextlib.suppress(TimeoutError):
                door.recv(4096)
        sent += 100  # a connection counts, too
    return 0


def datagrams(mark: Mark, seed: int) -> int:
    """Send noise and mutated datagrams."""
    generator, sent = random.Random(seed), 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as door:
        while sent < mark.count:
            data = chunk(generator, mark.words)
            sent += len(data)
            with contextlib.suppress(OSError):
                door.sendto(data, (mark.host, mark.port))
            if generator.randrange(50) == 0:
                time.sleep(0.001)  # so that the receiver reads them
    return 0


def slowly(mark: Mark, seed: int) -> int:
    """Hold connections that send a byte a second of a request that never ends."""
    generator = random.Random(seed)
    held: list[socket.socket] = []
    for _ in range(SLOW):
        with contextlib.suppress(OSError):
            held.append(socket.create_connection((mark.host, mark.port), WAIT))
    for _ in range(SLOWLY):
        for door in held:
            with contextlib.suppress(OSError):
                door.sendall(generator.choice(b"GET /api/summary HTTP/1.1\r\n").to_bytes(1))
        time.sleep(1.0)
    for door in held:
        door.close()
    return 0


def value(generator: random.Random, depth: int = 0) -> Any:
    """Return a value of JSON, of any kind."""
    kind = generator.randrange(10 if depth < 3 else 7)
    if kind < 7:
        return [
            None,
            generator.random() < 0.5,
            generator.randrange(-(2**70), 2**70),
            generator.choice([1e308, -0.0, 0.5, float("nan"), float("inf")]),
            "".join(generator.choices(string.printable, k=generator.randrange(40))),
            "\ud800\0/../" * generator.randrange(5),
            [],
        ][kind]
    count = generator.randrange(4)
    if kind == 7:
        return [value(generator, depth + 1) for _ in range(count)]
    names = [*"abcx", "name", "arguments", "values", "action", "camera", "role", "runs", "start"]
    return {generator.choice(names): value(generator, depth + 1) for _ in range(count)}


def body(generator: random.Random) -> bytes:
    """Return the body of a request."""
    kind = generator.randrange(20)
    if kind == 0:
        return b"[" * 20_000
    if kind == 1:
        return generator.randbytes(LARGE)
    if kind < 5:
        return generator.randbytes(generator.randrange(400))
    return json.dumps(value(generator)).encode("utf-8", "surrogatepass")


def requests(mark: Mark, seed: int) -> int:
    """Send requests with any bodies to all routes; return how many that change something passed."""
    import httpx

    generator, sent, obeyed = random.Random(seed), 0, 0
    kinds = ("application/json", "text/plain", "application/x-www-form-urlencoded")
    with httpx.Client(base_url=f"http://{mark.host}:{mark.port}", timeout=30) as client:
        while sent < mark.count:
            method, path = generator.choice(mark.words).split()
            content = body(generator) if method not in ("GET", "HEAD") else b""
            headers = {"content-type": generator.choice(kinds), "origin": mark.origin}
            if mark.cookie:
                headers["cookie"] = mark.cookie
            query = generator.choice(
                ["", "?limit=-1&offset=99999999999", "?name=%00&x=..%2f", "?a"]
            )
            with contextlib.suppress(httpx.TransportError):
                answer = client.request(method, path + query, content=content, headers=headers)
                obeyed += method != "GET" and answer.status_code in ALLOWED
                obeyed += answer.status_code >= 500
            sent += len(content) + 500  # the head, about
    return obeyed


def frames(mark: Mark, seed: int) -> int:
    """Send any frames on a page's sockets, a new one when the laboratory closes it."""
    logging.disable()  # the client's own lines about connections that are closed on it
    generator, sent = random.Random(seed), 0
    while sent < mark.count:
        path, protocol = generator.choice(mark.words)
        sent += 500
        with contextlib.suppress(OSError, WebSocketException):
            door = connect(
                f"ws://{mark.host}:{mark.port}{path}",
                additional_headers={"Cookie": mark.cookie} if mark.cookie else None,
                origin=Origin(mark.origin) if mark.origin else None,
                subprotocols=[protocol] if protocol else None,
                open_timeout=WAIT,
                close_timeout=0.2,
                max_size=None,
            )
            with door:
                for _ in range(generator.randrange(1, 600)):
                    data = frame(generator)
                    sent += len(data)
                    door.send(data)
    return 0


def frame(generator: random.Random) -> str | bytes:
    """Return a frame of a websocket: text, bytes, a stick's, a huge one."""
    kind = generator.randrange(12)
    if kind == 0:
        return generator.randbytes(generator.choice([28, 28, 9, 4097, 70_000]))
    if kind == 1:
        return "[" * 20_000
    if kind < 6:
        return generator.randbytes(generator.randrange(1, 200))
    text = json.dumps(value(generator))
    return text.encode("utf-8", "replace").decode()


def greeting() -> list[bytes]:
    """Return the first bytes that a node sends to the station's router."""
    found: list[bytes] = []
    with socket.create_server(("127.0.0.1", 0)) as door:
        door.settimeout(WAIT)

        def hear() -> None:
            with contextlib.suppress(OSError):
                connection, _ = door.accept()
                with connection:
                    connection.settimeout(WAIT)
                    found.append(connection.recv(4096))

        listening = threading.Thread(target=hear)
        listening.start()
        with contextlib.suppress(LinkError):
            loopback_session(door.getsockname()[1]).close()
        listening.join()
    return found
