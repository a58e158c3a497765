"""Emergency land of a signed-in page while a clock is set, the page is flooded, the station dies.

    python -m benchmarks emergencies [--quick | --smoke]

The vehicle hovers. A press counts from the request until a summary shows the vehicle's
acknowledgement; one that takes longer than 1 s is one after which the page says what to press
instead, by a timer of its own (`tests/page/emergency_press.test.js`).
"""

from __future__ import annotations

import itertools
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.safety import attackers
from benchmarks.safety.attackers import Attack, Mark
from benchmarks.safety.hostile_doors import routes, signed_in
from benchmarks.safety.laboratory import Laboratory
from benchmarks.safety.laboratory_faults import reach
from benchmarks.safety.page_latency import cookie_of
from benchmarks.safety.site import Site
from benchmarks.safety.starving import FAULTS, Place, fault

PRESSES = 20, 3, 1
"""Presses of each kind, of each size."""
FLOOD = "page flooded"
KINDS = {
    "clock set": [name for name in FAULTS if name.startswith("clock ")],
    FLOOD: [FLOOD],
    "station killed": ["station killed"],
}
WITHIN = 1.0
"""Time, in s, after which the page says what to press instead."""
LONGEST = 30.0
"""Longest time, in s, to wait for the acknowledgement."""
LOOK = 0.02  # s
MANY = 10**9


@contextmanager
def flooded(lab: Laboratory) -> Iterator[None]:
    """Attack the page within the block: bytes of nobody, routes and a websocket as a viewer."""
    viewer, port = cookie_of(signed_in(lab, "viewer")), lab.port
    paths = [path for path in routes(lab) if not any(one in path for one in attackers.OF_VIEWERS)]
    of_viewer = {"cookie": viewer, "origin": lab.base}
    marks: list[tuple[Attack, Mark]] = [
        (attackers.bytes_on_connections, Mark(port, MANY, words=[b"GET / HTTP/1.1\r\n\r\n"])),
        (attackers.requests, Mark(port, MANY, words=paths, **of_viewer)),
        (attackers.frames, Mark(port, MANY, words=[("/ws/events", "")], **of_viewer)),
    ]
    with ProcessPoolExecutor(len(marks), mp_context=get_context("spawn")) as pool:
        for number, (attack, mark) in enumerate(marks):
            pool.submit(attack, mark, number)
        try:
            time.sleep(LONGEST / 10)
            yield
        finally:
            for process in list((pool._processes or {}).values()):
                process.kill()


def pressed(lab: Laboratory) -> float:
    """Press Emergency land; return the s until it is acknowledged, or LONGEST."""
    began = time.monotonic()
    while (took := time.monotonic() - began) < LONGEST:
        lab.does("emergency", action="land")
        while time.monotonic() - began < took + WITHIN:
            press = lab.summary().get("emergency") or {}
            if press.get("phase") == "acknowledged" and press["age"] <= time.monotonic() - began:
                return time.monotonic() - began
            time.sleep(LOOK)
    return LONGEST


def press_once(place: Place, name: str) -> float:
    """Hover, press under a condition, and wait until the vehicle is ready again. Raises
    QuadlabError.
    """
    lab = place.lab
    reach(lab, "hovering")
    with flooded(lab) if name == FLOOD else fault(name, place):
        took = pressed(lab)
    print(f"{name}: {took:.2f} s", file=sys.stderr, flush=True)
    lab.until("touch-down", lab.is_down)
    lab.until("ready", lambda: (lab.summary().get("preflight") or {}).get("ready"))
    return took


def run(size: Size = Size.FULL) -> Report:
    """Press in each condition. Raises QuadlabError when a laboratory does not start."""
    count = size.of(*PRESSES)
    report = Report(
        "emergencies",
        "Emergency land under a clock that is set, a flood, and a station that dies",
        [f"{count} presses of each kind; the vehicle hovers at 1 m"],
    )
    with tempfile.TemporaryDirectory(prefix="quadlab-presses-") as folder:
        site = Site(Path(folder))
        try:
            for kind, names in KINDS.items():
                took = [
                    press_once(site.place(), name)
                    for name in itertools.islice(itertools.cycle(names), count)
                ]
                late = sum(one > WITHIN for one in took)
                report.rows.append(
                    Row(
                        kind,
                        {
                            "median, s": sorted(took)[len(took) // 2],
                            "longest, s": max(took),
                            "acknowledged after 1 s": float(late),
                        },
                    )
                )
                report.targets.append(Target(f"{kind}: longest, s", max(took), LONGEST))
        finally:
            site.close()
    return report
