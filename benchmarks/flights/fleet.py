"""Measure whether the simulated vehicles of one `quadlab up` hover together, and the cost.

    python -m benchmarks fleet

The whole `quadlab up --vehicles 8`, with no page open. All are armed, take off, hover and land over
the station as from a terminal. They are checked for flight and recording all the time; the heights
are the true ones.
"""

from __future__ import annotations

import contextlib
import re
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.page.laboratory import TICK, processes, started
from quadlab.station_client import REACH, StationClient
from quadrotor.errors import LinkError, QuadlabError, RefusedError
from vehicle_link.messages.records import Log
from vehicle_link.transport.loopback import loopback_session

PORT, LINK_PORT = 28082, 28450
COUNT = 8, 3, 2  # of each size
HOVER = 60.0, 10.0, 1.0  # s
PATIENCE = 120.0  # s
HEIGHT, NEAR = 1.0, 0.1  # m
TOPICS = ("status", "truth", "station_status", "link_status")
TOLD = 6
"""The number of a vehicle's newest events that an error tells."""
SETTLED = 5.0, 5.0, 0.5  # s of each size, after the last one has reached its height
LOOK = 0.25  # s


class Pilot:
    """The pilot of one vehicle: its newest messages, and commands to it."""

    def __init__(self, client: StationClient) -> None:
        self._client = client
        self._refusal = ""
        self.wrong: Counter[str] = Counter()
        self.looks = 0
        self.lowest, self.highest = float("inf"), -float("inf")
        self._newest = {topic: client.newest(topic) for topic in TOPICS}
        self._events = client.listen("events")

    def __str__(self) -> str:
        events = [self._events.get() for _ in range(self._events.qsize())]
        texts = [one.msg for one in events if isinstance(one, Log)]
        status, told = self.newest("status"), ", ".join(texts[-TOLD:])
        return f"{status.mode} {status.behavior} at {self.height:.2f} m ({told})"

    def newest(self, topic: str) -> Any:
        return self._newest[topic]()

    def rise(self) -> None:
        """Arm and take off; repeat while refused, as a vehicle that has just started is."""
        until(lambda: self._is_done("arm", "start_behavior", name="take_off"), *self._why("rise"))

    def land(self) -> None:
        """Land, unless the vehicle has landed by itself."""
        until(
            lambda: not self.is_airborne or self._is_done("start_behavior", name="land"),
            *self._why("land"),
        )

    def _is_done(self, *asked: str, **fields: str) -> bool:
        try:
            for one in asked:
                self._client.ask(one, **(fields if one == asked[-1] else {}))
        except (RefusedError, LinkError) as error:
            self._refusal = str(error)
            return False
        return True

    def _why(self, what: str) -> tuple[str, Callable[[], str]]:
        return what, lambda: self._refusal

    @property
    def is_airborne(self) -> bool:
        return bool(self.newest("status").airborne)

    @property
    def height(self) -> float:
        return float(self.newest("truth").pose.pose.position.z)

    @property
    def is_up(self) -> bool:
        return self.newest("truth") is not None and abs(self.height - HEIGHT) <= NEAR

    def look(self) -> None:
        """Count deviations from what is expected while it hovers."""
        status, height = self.newest("status"), self.height
        self.looks += 1
        self.lowest, self.highest = min(self.lowest, height), max(self.highest, height)
        self.wrong["not hovering"] += status.behavior != "hover" or not status.airborne
        self.wrong["not recorded"] += not self.newest("station_status").recording
        self.wrong["link not good"] += self.newest("link_status").state != "good"


def run(size: Size = Size.FULL) -> Report:
    """Fly a fleet. Raises QuadlabError when the vehicles do not start."""
    count, hover = size.of(*COUNT), size.of(*HOVER)
    report = Report(
        "fleet",
        "Several vehicles on one computer",
        [
            f"{count} simulated vehicles hover {hover:g} s, each recorded, no page open",
            "CPU of all processes while they hover, in percent of one core",
        ],
    )
    # Of the shortest form nothing is claimed, and simulated time waits for a busy computer.
    lab = laboratory(count, lockstep=size is Size.SMOKE)
    with lab as (up, lines), contextlib.ExitStack() as stack:
        names = [f"quad{number}" for number in range(1, count + 1)]
        session = loopback_session(LINK_PORT, REACH)
        stack.callback(session.close)
        pilots = [Pilot(stack.enter_context(closing(StationClient(session, n)))) for n in names]
        for pilot in pilots:
            pilot.rise()
        until(
            lambda: all(pilot.is_up for pilot in pilots),
            "all at their height",
            lambda: "; ".join(f"{name} {pilot}" for name, pilot in zip(names, pilots, strict=True)),
        )
        time.sleep(size.of(*SETTLED))
        costs, stolen = hovering(up, pilots, hover)
        report.rows = [
            Row(
                name,
                {
                    "lowest, m": pilot.lowest,
                    "highest, m": pilot.highest,
                    **shares(pilot),
                    "frames missed, %": 100.0 * pilot.newest("status").missed_share,
                },
            )
            for name, pilot in zip(names, pilots, strict=True)
        ]
        for pilot in pilots:
            pilot.land()
        until(lambda: not any(pilot.is_airborne for pilot in pilots), "all on the ground")
    report.notes.append(
        "CPU, % of a core: " + ", ".join(f"{name} {cost:.0f}" for name, cost in costs.items())
    )
    report.notes.append(f"taken by the host meanwhile: {stolen:.0f} % of a core")
    stops = re.findall(r"simulator: (this machine stopped for [\d.]+ s)", "".join(lines))
    report.notes.append("the simulator says: " + ("; ".join(stops) or "nothing"))
    held = sum(not pilot.wrong["not hovering"] for pilot in pilots)
    report.targets = [Target("hovered all the time", held, count, at_most=False)]
    return report


def shares(pilot: Pilot) -> dict[str, float | str]:
    return {f"{what}, %": 100.0 * times / pilot.looks for what, times in pilot.wrong.items()}


def hovering(up: int, pilots: list[Pilot], duration: float) -> tuple[dict[str, float], float]:
    """Check all pilots for `duration` s.

    Returns processor time by process, in % of a core, and the share that the host took.
    """
    before, stolen, began = cpu_ticks(up), taken(), time.monotonic()
    while time.monotonic() < began + duration:
        for pilot in pilots:
            pilot.look()
        time.sleep(LOOK)
    took = time.monotonic() - began
    spent = cpu_ticks(up)
    spent.subtract(before)
    costs = {name: 100.0 * ticks / TICK / took for name, ticks in spent.most_common()}
    return {**costs, "all": sum(costs.values())}, 100.0 * (taken() - stolen) / took


def cpu_ticks(up: int) -> Counter[str]:
    """Return the processor ticks of `up` and its descendants, those of one kind together."""
    spent: Counter[str] = Counter()
    for pid, name in processes(up).items():
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        spent[name] += int(fields[11]) + int(fields[12])
    return spent


def taken() -> float:
    """Return the processor time (s) that the host gave to other machines."""
    return int(Path("/proc/stat").read_text().split()[8]) / TICK


@contextmanager
def laboratory(count: int, *, lockstep: bool = False) -> Iterator[tuple[int, list[str]]]:
    """Yield the process of `quadlab up`, once its page is up, and its output lines, which grow."""
    words = ("--vehicles", str(count))
    with started(PORT, LINK_PORT, *words, lockstep=lockstep) as (up, lines):
        try:
            until(lambda: "token=" in "".join(lines), "the page")
            yield up, lines
        except QuadlabError as error:
            raise QuadlabError(f"{error}\n{''.join(lines[-30:])}") from error


def until(look: Callable[[], bool], what: str, why: Callable[[], str] = lambda: "") -> None:
    end = time.monotonic() + PATIENCE
    while not look():
        if time.monotonic() > end:
            raise QuadlabError(f"{what}: waited {PATIENCE:.0f} s in vain. {why()}")
        time.sleep(0.2)
