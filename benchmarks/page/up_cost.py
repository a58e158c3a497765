"""Measure the cost of `quadlab up`: its start, and processor time, threads and memory of all
processes.

    python -m benchmarks up_cost [--against TREE]

One simulated vehicle hovers with no page open, then flies an 8 with one. With another checkout,
which needs its own environment, both run in turns.

Processor time is what the kernel counts for the processes, so other work on the machine affects it
little. The page is replaced by a client with the same three websockets, because a browser that
draws in software would take the processor that simulated time needs.
"""

from __future__ import annotations

import copy
import json
import re
import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.page.laboratory import (
    Socket,
    cpu_seconds,
    memory_mb,
    processes,
    started,
    threads,
    until,
    viser_protocol,
)
from quadrotor.checkout import ROOT

PORT, LINK_PORT = 28090, 28460
ROUNDS, SECONDS = (3, 1, 1), (30.0, 10.0, 1.0)  # of each size
SETTLED = 5.0, 5.0, 0.5  # s
LAPS, SIGNALS = 20, 40
PATIENCE = 240.0  # s; a busy machine starts slowly
LOOK = 0.1  # s between two looks at the vehicle, which cost its station time
LIMITS = {
    "hover: processor": 0.5,
    "page, 8: processor": 0.7,
    "page, 8: memory": 0.8,
    "start to page": 1.0,
    "start to vehicle": 1.0,
}
"""Largest ratios to the other checkout."""
THREADS = 70

Figures = dict[str, float]


def run(size: Size = Size.FULL, against: str | None = None) -> Report:
    """Measure this checkout, in turns with the one at `against` if given."""
    rounds, seconds = size.of(*ROUNDS), size.of(*SECONDS)
    trees = {"this": ROOT} | ({"other": Path(against)} if against else {})
    found: dict[str, list[Figures]] = {name: [] for name in trees}
    for _ in range(rounds):
        for name, tree in trees.items():
            began = time.monotonic()
            with started(PORT, LINK_PORT, tree=tree, lockstep=True) as (up, lines):
                found[name].append(measure(up, lines, began, size))
    figures = {
        name: {key: statistics.median(one.get(key, 0.0) for one in of) for key in of[0]}
        for name, of in found.items()
    }
    report = Report(
        "up_cost",
        "What `quadlab up` costs",
        [
            f"one simulated vehicle in lockstep; {rounds} starts, {seconds:g} s each; medians",
            "processor: of all its processes, in cores; memory: proportional set size, MB",
            "page: a client with the page's three websockets, whose own time does not count",
        ],
    )
    mine, other = figures["this"], figures.get("other", {})
    for key, value in mine.items():
        row: dict[str, float | str] = {"this checkout": value}
        if other.get(key):
            pairs = zip(found["this"], found["other"], strict=True)
            ratio = statistics.median(one[key] / its[key] for one, its in pairs if its.get(key))
            row |= {"the other": other[key], "ratio": ratio}
            if key in LIMITS:
                report.targets.append(Target(f"{key}, times the other's", ratio, LIMITS[key]))
        report.rows.append(Row(key, row))
    report.targets.append(Target("hover: threads", mine["hover: threads"], THREADS))
    return report


class Pilot:
    """A signed-in client that flies the vehicle of `quadlab up`.

    Attributes:
        times: s from the start to the page and to the vehicle.
    """

    def __init__(self, browser: httpx.Client, link: str, began: float) -> None:
        self.browser, self.link, self.base = browser, link, link.split("/?", maxsplit=1)[0]
        self.times = {"start to page": time.monotonic() - began}
        browser.base_url, browser.headers["origin"] = self.base, self.base
        browser.post("/login", data={"token": link.partition("token=")[2]}).raise_for_status()
        until(lambda: self.summary().get("status"), PATIENCE)
        self.times["start to vehicle"] = time.monotonic() - began

    def of_vehicle(self, browser: httpx.Client, name: str) -> Pilot:
        """Return a pilot of another vehicle of the fleet, with a client that is signed in."""
        browser.base_url, browser.headers["origin"] = f"{self.base}/v/{name}", self.base
        found = copy.copy(self)
        found.browser = browser
        return found

    def summary(self) -> dict[str, Any]:
        answer: dict[str, Any] = self.browser.get("/api/summary").json()
        return answer

    def cookies(self) -> Any:
        """Return the session's cookies, for a browser."""
        jar = self.browser.cookies.jar
        return [{"name": one.name, "value": one.value or "", "url": self.base} for one in jar]

    def command(self, name: str, /, **body: Any) -> None:
        answer = self.browser.post(f"/api/commands/{name}", json=body)
        assert answer.is_success, f"{name} refused: {answer.text}"

    def start(self, behavior: str, until_flown: str, **arguments: float | str) -> None:
        """Start a behavior and wait until the vehicle is in `until_flown`."""
        self.command("start_behavior", name=behavior, arguments=arguments)
        until(
            lambda: (self.summary().get("status") or {}).get("behavior") == until_flown, every=LOOK
        )

    def take_off(self) -> None:
        until(lambda: (self.summary().get("preflight") or {}).get("ready"), PATIENCE, LOOK)
        self.command("arm")
        until(lambda: self.summary()["status"]["mode"] == "armed", every=LOOK)
        self.start("take_off", "hover")


@contextmanager
def pilot(lines: list[str], port: int, began: float) -> Iterator[Pilot]:
    """Yield a pilot, once `quadlab up` answers and is connected to the vehicle."""
    with httpx.Client(base_url=f"http://127.0.0.1:{port}") as knocking:
        until(lambda: _answers(knocking), PATIENCE)
    link = until(lambda: re.findall(r"http://\S+token=\S+", "".join(lines)), PATIENCE)[-1]
    with httpx.Client(timeout=10) as browser:
        yield Pilot(browser, link, began)


def measure(up: int, lines: list[str], began: float, size: Size) -> Figures:
    """Hover, then fly with a page open; return the figures of both."""
    with pilot(lines, PORT, began) as flown:
        flown.take_off()
        figures = flown.times | counted("hover", up, size)
        with page(flown):
            flown.start("follow_trajectory", "follow_trajectory", laps=LAPS)
            figures |= counted("page, 8", up, size)
            figures["page, 8: real-time factor"] = flown.summary()["station"]["real_time_factor"]
    return figures


def counted(what: str, up: int, size: Size) -> Figures:
    """Measure for the seconds of this size, once the start has settled."""
    time.sleep(size.of(*SETTLED))
    pids = processes(up)
    before, since = cpu_seconds(pids), time.monotonic()
    time.sleep(size.of(*SECONDS))
    after, elapsed = cpu_seconds(pids), time.monotonic() - since
    shares = {name: (after[name] - before[name]) / elapsed for name in after}
    return {
        **{f"{what}: processor of {name}": share for name, share in sorted(shares.items())},
        f"{what}: processor": sum(shares.values()),
        f"{what}: threads": sum(threads(pids).values()),
        f"{what}: memory": sum(memory_mb(pids).values()),
    }


@contextmanager
def page(flown: Pilot) -> Iterator[None]:
    """Keep the three websockets of a page open."""
    cookie = "; ".join(f"{one.name}={one.value}" for one in flown.browser.cookies.jar)
    web = flown.base.replace("http", "ws")
    names = [one["name"] for one in flown.browser.get("/api/signals").json()["signals"]][:SIGNALS]
    sockets = [
        Socket(f"{web}/ws/telemetry", cookie, json.dumps({"id": 1, "signals": names})),
        Socket(f"{web}/ws/events", cookie),
        Socket(f"{web}/viser?view=benchmark", cookie, subprotocols=[viser_protocol()]),
    ]
    try:
        yield
    finally:
        for socket in sockets:
            socket.close()


def _answers(page: httpx.Client) -> bool:
    try:
        return page.get("/").status_code < 500
    except httpx.TransportError:
        return False
