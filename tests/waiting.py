"""Helpers of tests with real processes and sessions: a free port, and bounded waiting."""

from __future__ import annotations

import itertools
import os
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

T = TypeVar("T")
PORTS_EACH = 2500
_tried = itertools.count(os.getpid())
LIMIT = 60.0
"""Longest time, in s, which only a broken program needs."""


def free_port(kind: int = socket.SOCK_STREAM) -> int:
    """Return a port of this kind on loopback that is free now, and a different one each time.

    It is below those that the kernel gives to connections, and in a range of this process of
    pytest-xdist, so that nobody takes it before the test does.
    """
    process = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % 4
    while True:
        port = 10_000 + PORTS_EACH * process + next(_tried) % PORTS_EACH
        with socket.socket(socket.AF_INET, kind) as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


def until(condition: Callable[[], T], bound: float = LIMIT) -> T:
    """Poll; return the first true result, or the last one at the end of the bound (s)."""
    waiting, end = threading.Event(), time.monotonic() + bound
    while not (answer := condition()) and time.monotonic() < end:
        waiting.wait(0.01)
    return answer


def wait_for(condition: Callable[[], object], bound: float = LIMIT, what: str = "it") -> None:
    """Poll until the condition is true; fail at the end of the bound (s) with `what`."""
    assert until(condition, bound), f"waited {bound:.0f} s for {what} in vain"
