"""Numbers a chart or the state table can show: name, label, unit, and where each comes from.

First the named ones, in the units people think in; then every other number of the topics that are
kept (`web.live.latest.STALE`), made from their message types. A value is NaN when its topic
is stale or absent: the charts draw a gap, the table greys the cell.
"""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import asdict
from functools import cache
from typing import Any

import msgspec

from web.live.latest import STALE, Live
from web.signals.estimates import COMPARED, ESTIMATES, RESULTS
from web.signals.health import HEALTH
from web.signals.motion import MOTION
from web.signals.plain import sources_of
from web.signals.signal import Signal, Source

__all__ = ["COMPARED", "INDEX", "NAMED", "SIGNALS", "Signal", "describe", "described", "snapshot"]

_NAMED = (*MOTION, *HEALTH, *ESTIMATES)


def _plain() -> list[Source]:
    covered = {path for source in _NAMED for path in source.covers}
    found: list[Source] = []
    for topic in STALE:
        below = f"{topic}."
        found += sources_of(topic, {p.removeprefix(below) for p in covered if p.startswith(below)})
    return found


_SOURCES = (*_NAMED, *_plain(), *RESULTS)
SIGNALS: tuple[Signal, ...] = tuple(s for source in _SOURCES for s in source.signals)
NAMED = sum(len(source.signals) for source in _NAMED)
"""How many of SIGNALS, from the first on, have a name of their own."""
INDEX: dict[str, int] = {signal.name: i for i, signal in enumerate(SIGNALS)}
_NAMES = [frozenset(signal.name for signal in source.signals) for source in _SOURCES]


def snapshot(live: Live, wanted: Set[str] | None = None) -> list[float]:
    """Return the values now, in the order of SIGNALS; NaN where stale.

    Args:
        wanted: names; sources with none of them are not read and give NaN. None: all.
    """
    values: list[float] = []
    for source, names in zip(_SOURCES, _NAMES, strict=True):
        found = None
        if wanted is None or not wanted.isdisjoint(names):
            messages = [live.current(topic) for topic in source.topics]
            if all(message is not None for message in messages):
                found = source.values(*messages)
        values.extend([math.nan] * len(source.signals) if found is None else found)
    return values


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
    """Return the same as JSON."""
    return msgspec.json.encode(describe())
