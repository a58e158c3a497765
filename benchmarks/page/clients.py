"""Clients with the websockets of a page, in a process of their own. Part of `live_page`.

Browsers stand on other computers than the laboratory's. So these clients give way to everything
that flies: what they cost the flight is what the web process does for them.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path

from benchmarks.page.laboratory import Socket, viser_protocol
from benchmarks.page.live_signals import DEFAULT, SHOWN, asked_for
from benchmarks.page.up_cost import PATIENCE, Pilot

LAST = 19  # niceness: after everything else


@contextlib.contextmanager
def clients(flown: Pilot, count: int) -> Iterator[None]:
    """Keep so many pages with the default layout open, each with its three websockets."""
    names = [one["name"] for one in flown.browser.get("/api/signals").json()["signals"]][:SHOWN]
    cookie = "; ".join(f"{one.name}={one.value}" for one in flown.browser.cookies.jar)
    mine, theirs = multiprocessing.Pipe()
    order = (flown.base.replace("http", "ws"), cookie, names, count, theirs)
    process = multiprocessing.get_context("spawn").Process(target=_read, args=order, daemon=True)
    process.start()
    theirs.close()
    try:
        if not (mine.poll(PATIENCE) and mine.recv()):
            raise SystemExit(f"{count} clients were not connected within {PATIENCE:.0f} s")
        yield
    finally:
        process.terminate()
        process.join()


def _read(web: str, cookie: str, names: list[str], count: int, ready: Connection) -> None:
    """Read from all websockets, after everything else, until the process is ended."""
    os.setsid()
    os.setpriority(os.PRIO_PROCESS, 0, LAST)
    with contextlib.suppress(OSError):  # where the kernel groups processes by session
        Path("/proc/self/autogroup").write_text(str(LAST))
    for _ in range(count):
        Socket(f"{web}/ws/telemetry", cookie, asked_for(names, DEFAULT))
        Socket(f"{web}/ws/events", cookie)
        Socket(f"{web}/viser?view=benchmark", cookie, subprotocols=[viser_protocol()])
    ready.send(True)
    signal.pause()
