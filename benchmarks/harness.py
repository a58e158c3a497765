"""The common part of all benchmarks: fair timing, rows, targets, and their tables.

Methods are timed in turns, round by round, so that other load on the machine affects all of them; a
ratio is the median of the rounds' ratios. Each row has accuracy next to time.
"""

from __future__ import annotations

import shutil
import socket
import statistics
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, TypeVar

T = TypeVar("T")

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-headless-shell") or "chromium"
"""Chromium of Debian's packages of these names; the second needs no screen."""


class Size(StrEnum):
    """The extent of a benchmark: for a result, for a look, or to see that it still runs."""

    FULL = "full"
    QUICK = "quick"
    SMOKE = "smoke"

    def of(self, full: T, quick: T, smoke: T) -> T:
        """Return the setting that belongs to this size."""
        return {Size.FULL: full, Size.QUICK: quick, Size.SMOKE: smoke}[self]

    def some(self, items: Iterable[T], smoke: int = 1) -> list[T]:
        """Return all items, of a smoke run the first `smoke` alone."""
        return list(items)[: smoke if self is Size.SMOKE else None]


@dataclass(frozen=True)
class Timing:
    """Seconds per call in each round."""

    rounds: tuple[float, ...]

    @property
    def median(self) -> float:
        return statistics.median(self.rounds)

    @property
    def spread(self) -> tuple[float, float]:
        """Return the fastest and slowest round, s."""
        return min(self.rounds), max(self.rounds)

    def over(self, other: Timing) -> float:
        """Return the ratio of this time to `other`: the median of the rounds' ratios."""
        return statistics.median(a / b for a, b in zip(self.rounds, other.rounds, strict=True))


def time_in_turns(
    methods: Mapping[str, tuple[Callable[[], object], int]], rounds: int = 9
) -> dict[str, Timing]:
    """Time each `(function, calls per round)`.

    A function that does the work of many calls is passed as (function, 1), and the caller divides
    its figure.
    """
    for function, _ in methods.values():
        function()  # compile, fill caches
    found: dict[str, list[float]] = {name: [] for name in methods}
    for _ in range(rounds):
        for name, (function, calls) in methods.items():
            began = time.perf_counter()
            for _ in range(calls):
                function()
            found[name].append((time.perf_counter() - began) / calls)
    return {name: Timing(tuple(values)) for name, values in found.items()}


def free_port() -> int:
    """Return a port that is free for TCP and UDP on loopback right now."""
    while True:
        with (
            socket.socket(socket.AF_INET, socket.SOCK_STREAM) as tcp,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp,
        ):
            tcp.bind(("127.0.0.1", 0))
            port: int = tcp.getsockname()[1]
            with suppress(OSError):
                udp.bind(("127.0.0.1", port))
                return port


@dataclass
class Row:
    """One method in one table; a figure that does not apply is omitted."""

    method: str
    figures: dict[str, float | str]


@dataclass
class Target:
    """A target, and the value reached."""

    what: str
    reached: float
    limit: float
    at_most: bool = True

    @property
    def met(self) -> bool:
        return self.reached <= self.limit if self.at_most else self.reached >= self.limit


@dataclass
class Report:
    """The outcome of one benchmark: its conditions, one table, its targets, its plot data."""

    name: str
    title: str
    conditions: list[str]
    rows: list[Row] = field(default_factory=list)
    targets: list[Target] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    plot: dict[str, Any] | None = None  # see benchmarks.__main__.draw

    def columns(self) -> list[str]:
        names: dict[str, None] = {}
        for row in self.rows:
            names.update(dict.fromkeys(row.figures))
        return list(names)

    def as_json(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "title": self.title,
            "conditions": self.conditions,
            "rows": [{"method": row.method, **row.figures} for row in self.rows],
            "targets": [
                {"what": t.what, "reached": t.reached, "limit": t.limit, "met": t.met}
                for t in self.targets
            ],
            "notes": self.notes,
            "plot": self.plot,
        }

    def as_markdown(self) -> str:
        columns = self.columns()
        lines = [f"## {self.title}", "", *(f"- {one}" for one in self.conditions), ""]
        lines.append("| method | " + " | ".join(columns) + " |")
        lines.append("|---|" + "---:|" * len(columns))
        for row in self.rows:
            cells = [_text(row.figures.get(column)) for column in columns]
            lines.append(f"| {row.method} | " + " | ".join(cells) + " |")
        if self.targets:
            lines += ["", "| target | limit | reached | |", "|---|---:|---:|---|"]
            for t in self.targets:
                sign = "≤" if t.at_most else "≥"
                verdict = "met" if t.met else "**missed**"
                lines.append(f"| {t.what} | {sign} {t.limit:g} | {t.reached:.4g} | {verdict} |")
        if self.notes:
            lines += ["", *(f"- {one}" for one in self.notes)]
        return "\n".join(lines) + "\n"


def _text(value: float | str | None) -> str:
    if value is None:
        return ""
    return value if isinstance(value, str) else f"{value:.4g}"
