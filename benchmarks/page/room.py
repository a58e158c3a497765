"""A full room: pages open during a flight, and one page left open for long.

Run: .venv/bin/python -m benchmarks.page.room [--pages 10] [--seconds 30] [--soak MINUTES]

Pages are replaced by websockets in a separate process, three per page as in the browser, so that
the figures are of quadlab's processes and not of a browser's rendering. Flight lateness is paired:
without pages, with all, without, with. --soak opens one page in Chromium instead (3D view blank:
without a graphics card it occupies a core) and measures what grows.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import numpy as np
import websockets
from websockets.asyncio.client import connect

from benchmarks.harness import CHROMIUM
from benchmarks.page.laboratory import cpu_seconds, processes, until
from quadrotor.checkout import ROOT

CHARGE = 20
"""Capacity, in A h, of a battery that outlasts a soak."""
LIMITS = {"gap_p99_ms": 60.0, "web_percent": 25.0}


class Room:
    """`quadlab up` with a vehicle that flies eights, and a client that commands it."""

    def __init__(self, folder: str, port: int, link_port: int) -> None:
        self.up = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "quadlab",
                "up",
                "--no-browser",
                "--real-time",
                "--data",
                folder,
                "--port",
                str(port),
                "--link-port",
                str(link_port),
                "--set",
                f"simulator.battery_capacity={CHARGE}",
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=ROOT,
        )
        self.lines: list[str] = []
        reader = self.up.stdout
        assert reader is not None
        threading.Thread(
            target=lambda: self.lines.extend(iter(reader.readline, "")), daemon=True
        ).start()
        self.link = until(lambda: re.findall(r"http://\S+", "".join(self.lines)))[-1]
        self.base = self.link.split("/?")[0]
        self.browser = httpx.Client(base_url=self.base, headers={"origin": self.base}, timeout=10)
        assert self.browser.get(self.link, follow_redirects=True).status_code == 200
        self.cookie = "; ".join(f"{c.name}={c.value}" for c in self.browser.cookies.jar)

    def status(self) -> dict[str, Any]:
        return self.browser.get("/api/summary").json().get("status") or {}

    def command(self, command: str, /, **body: Any) -> bool:
        return self.browser.post(f"/api/commands/{command}", json=body).status_code == 200

    def fly(self) -> None:
        until(lambda: self.status().get("mode") == "ready")
        until(lambda: self.command("arm"))
        until(lambda: self.status()["mode"] == "armed")
        until(lambda: self.command("start_behavior", name="take_off"))
        until(lambda: self.status()["behavior"] == "hover")
        eights = {"laps": 1000}
        assert self.command("start_behavior", name="follow_trajectory", arguments=eights)

    def close(self) -> None:
        self.up.send_signal(signal.SIGINT)
        self.up.wait(60)


def options_of(base: str, cookie: str) -> dict[str, Any]:
    return {
        "additional_headers": {"Cookie": cookie},
        "origin": base,
        "max_size": None,
        "compression": None,
        "proxy": None,
    }


def view(base: str, cookie: str, name: str) -> Any:
    """Return a websocket of the 3D view."""
    import viser

    protocol = websockets.Subprotocol(f"viser-v{viser.__version__}")
    url = f"{base.replace('http', 'ws')}/viser?view={name}"
    return connect(url, subprotocols=[protocol], **options_of(base, cookie))


async def backlog(base: str, cookie: str) -> int:
    """Return the bytes of viser's history that a page receives in its first half second."""
    size = 0
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(0.5), view(base, cookie, "backlog") as socket:
            async for frame in socket:
                size += len(frame)
    return size


async def one_page(base: str, cookie: str, name: str, seconds: float) -> list[float]:
    """Return the times (s) at which frames of the 3D view arrived."""
    web, came = base.replace("http", "ws"), []
    options = options_of(base, cookie)
    signals = ["state.position.x", "state.position.y", "state.position.z"]

    async def drain(path: str, first: str | None = None) -> None:
        async with connect(web + path, **options) as socket:
            if first:
                await socket.send(first)
            async for _ in socket:
                pass

    others = [
        asyncio.create_task(drain("/ws/events")),
        asyncio.create_task(drain("/ws/telemetry", json.dumps({"id": 1, "signals": signals}))),
    ]
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(seconds), view(base, cookie, name) as socket:
            async for _ in socket:
                came.append(time.perf_counter())
    for task in others:
        task.cancel()
    await asyncio.gather(*others, return_exceptions=True)
    return came


async def pages(base: str, cookie: str, count: int, seconds: float) -> None:
    """Run the process of the pages: print the gaps (ms) after the first two seconds."""
    each = await asyncio.gather(
        *(one_page(base, cookie, f"page{i}", seconds) for i in range(count))
    )
    gaps = [1e3 * np.diff([t for t in came if t > came[0] + 2.0]) for came in each]
    together = np.concatenate(gaps)
    print(
        json.dumps(
            {
                "frames_hz": float(statistics.median(1e3 / float(np.mean(g)) for g in gaps)),
                "gap_p50_ms": float(np.median(together)),
                "gap_p99_ms": float(np.percentile(together, 99)),
                "gap_max_ms": float(np.max(together)),
            }
        )
    )


@contextlib.contextmanager
def sampled(room: Room, out: list[dict[str, float]]) -> Iterator[None]:
    """Sample the vehicle's loop statistics each second, and the processor share of web."""
    pids = processes(room.up.pid)
    stop, lateness = threading.Event(), []

    def look() -> None:
        while not stop.wait(1.0):
            lateness.append(room.status())

    before, since = cpu_seconds(pids), time.monotonic()
    thread = threading.Thread(target=look, daemon=True)
    thread.start()
    yield
    stop.set()
    thread.join()
    spent = cpu_seconds(pids)["web"] - before["web"]
    out.append(
        {
            "web_percent": 100 * spent / (time.monotonic() - since),
            "lateness_p99_ms": 1e3 * statistics.median(s["lateness_p99"] for s in lateness),
            "missed_percent": 100 * statistics.median(s["missed_share"] for s in lateness),
        }
    )


def full_room(room: Room, count: int, seconds: float) -> None:
    room.fly()
    empty: list[dict[str, float]] = []
    full: list[dict[str, float]] = []
    gaps: list[dict[str, float]] = []
    for _ in range(2):
        with sampled(room, empty):
            time.sleep(seconds)
        with sampled(room, full):
            answer = subprocess.run(
                [
                    sys.executable,
                    "-m",
                    "benchmarks.page.room",
                    "--be-pages",
                    room.base,
                    room.cookie,
                    "--pages",
                    str(count),
                    "--seconds",
                    str(seconds),
                ],
                capture_output=True,
                text=True,
                check=True,
                cwd=ROOT,
            )
            gaps.append(json.loads(answer.stdout))
    for name in empty[0]:
        print(
            f"{name:18} no page {_median(empty, name):8.3f}   {count} pages "
            f"{_median(full, name):8.3f}{_limit(name)}"
        )
    for name in gaps[0]:
        print(f"{name:18} {_median(gaps, name):8.3f}{_limit(name)}")


def soak(room: Room, minutes: float) -> None:
    """Measure the memory of one page in Chromium and of the web process, ten times."""
    from playwright.sync_api import sync_playwright

    room.fly()
    invited = room.browser.post("/api/invitations", json={"role": "viewer"}).json()["url"]
    # Playwright's own event loop occupies this thread.
    with sync_playwright() as api, ThreadPoolExecutor(1) as beside:
        browser = api.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.route("**/viser/**", lambda route: route.fulfill(status=200, body=""))
        page.goto(invited)
        page.wait_for_selector("#behaviors button")
        page.keyboard.press("Escape")
        session = page.context.new_cdp_session(page)
        session.send("HeapProfiler.enable")
        print("minute  heap MB  nodes  listeners  web MB  all MB  3D backlog kB")
        for sample in range(11):
            page.wait_for_timeout(6e3 * minutes if sample else 20_000)
            session.send("HeapProfiler.collectGarbage")
            counted = session.send("Memory.getDOMCounters")
            heap = session.send("Runtime.getHeapUsage")["usedSize"] / 1e6
            sizes = resident_mb(processes(room.up.pid))
            kept = beside.submit(asyncio.run, backlog(room.base, room.cookie)).result()
            print(
                f"{sample * minutes / 10:6.1f} {heap:8.2f} {counted['nodes']:6d} "
                f"{counted['jsEventListeners']:10d} {sizes['web']:7.1f} "
                f"{sum(sizes.values()):7.1f} {kept / 1e3:14.1f}",
                flush=True,
            )
        browser.close()


def resident_mb(pids: dict[int, str]) -> dict[str, float]:
    sizes = {}
    for pid, name in pids.items():
        with open(f"/proc/{pid}/status") as file:
            sizes[name] = int(re.search(r"VmRSS:\s+(\d+)", file.read())[1]) / 1e3  # type: ignore[index]
    return sizes


def _median(rows: list[dict[str, float]], name: str) -> float:
    return statistics.median(row[name] for row in rows)


def _limit(name: str) -> str:
    return f"   limit {LIMITS[name]:g}" if name in LIMITS else ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pages", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--soak", type=float, metavar="MINUTES")
    parser.add_argument("--port", type=int, default=28180)
    parser.add_argument("--link-port", type=int, default=28547)
    parser.add_argument("--be-pages", nargs=2, metavar=("URL", "COOKIE"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.be_pages:
        url, cookie = options.be_pages
        asyncio.run(pages(url, cookie, options.pages, options.seconds))
        return
    with tempfile.TemporaryDirectory() as folder:
        room = Room(folder, options.port, options.link_port)
        try:
            if options.soak:
                soak(room, options.soak)
            else:
                full_room(room, options.pages, options.seconds)
        finally:
            room.close()


if __name__ == "__main__":
    main()
