"""Numbers that a chart or the state table can show: name, label, unit, and source.

The named ones come first, in units that are easy to read; then every other number of the topics
that are stored (`web.latest.STALE`), made from their message types. A value is NaN when its
topic is stale or missing: the charts draw a gap, the table shows the cell in grey.
"""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import asdict
from functools import cache, lru_cache
from typing import Any

import msgspec

from web.latest import STALE, Live
from web.signals.estimates import COMPARED, ESTIMATES, RESULTS
from web.signals.health import HEALTH
from web.signals.motion import MOTION
from web.signals.plain import sources_of
from web.signals.signal import Signal, Source

__all__ = [
    "COMPARED",
    "INDEX",
    "NAMED",
    "NAMED_SOURCES",
    "SIGNALS",
    "UNITS",
    "Signal",
    "Source",
    "describe",
    "described",
    "snapshot",
]

NAMED_SOURCES = (*MOTION, *HEALTH, *ESTIMATES)


def _plain() -> list[Source]:
    shown = {"comparison": {"estimators"}}
    for source in NAMED_SOURCES:
        if source.factors and not source.member:
            shown.setdefault(source.topic, set()).update(source.columns)
    return [source for topic in STALE for source in sources_of(topic, shown.get(topic, ()))]


_SOURCES = (*NAMED_SOURCES, *_plain(), *RESULTS)
SIGNALS: tuple[Signal, ...] = tuple(s for source in _SOURCES for s in source.signals)
NAMED = sum(len(source.signals) for source in NAMED_SOURCES)
"""Number of leading SIGNALS that have their own names."""
INDEX: dict[str, int] = {signal.name: i for i, signal in enumerate(SIGNALS)}
UNITS: dict[str, str] = {signal.name: signal.unit for signal in SIGNALS}
_NOTHING = [math.nan] * len(SIGNALS)


@lru_cache(maxsize=64)
def _plan(wanted: Set[str] | None) -> list[tuple[Source, slice, list[int]]]:
    """Return the sources to read, with the places of their signals and of their inputs."""
    needed = set(INDEX if wanted is None else wanted)
    found = []
    for source in reversed(_SOURCES):  # inputs are listed before the signals made of them
        if needed.isdisjoint(signal.name for signal in source.signals):
            continue
        needed.update(source.inputs)
        first = INDEX[source.signals[0].name]
        place = slice(first, first + len(source.signals))
        found.append((source, place, [INDEX[name] for name in source.inputs]))
    return found[::-1]


def snapshot(live: Live, wanted: frozenset[str] | None = None) -> list[float]:
    """Return the present values, in the order of SIGNALS; NaN where stale.

    Args:
        wanted: names of signals; sources with none of them are not read and give NaN. None: all.
    """
    values = _NOTHING.copy()
    messages: dict[str, Any] = {}
    for source, place, inputs in _plan(wanted):
        topic = source.topic
        if topic not in messages:
            messages[topic] = live.current(topic)
        if (message := messages[topic]) is not None:
            found = source.values(message, [values[i] for i in inputs])
            if found is not None:
                values[place] = found
    return values


def topics_for(wanted: frozenset[str]) -> frozenset[str]:
    """Return the topics from which the values of these signals are computed."""
    return frozenset(source.topic for source, _, _ in _plan(wanted))


def describe() -> dict[str, Any]:
    """Return what the page needs to list and label the signals."""
    return {
        "signals": [asdict(signal) for signal in SIGNALS],
        "named": NAMED,
        "topics": list(STALE),
        "stale": STALE,
    }


@cache
def described() -> bytes:
    """Return `describe` as JSON."""
    return msgspec.json.encode(describe())
