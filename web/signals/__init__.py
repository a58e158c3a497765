"""Numbers that a chart or the state table can show: name, label, unit, and source.

The named ones come first, in units that are easy to read; then every other number of the topics
that are stored (`web.latest.STALE`), made from their message types.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import asdict
from functools import cache

import msgspec

from web.latest import STALE
from web.signals.estimates import COMPARED, ESTIMATES, RESULTS
from web.signals.evaluator import Place
from web.signals.health import HEALTH
from web.signals.motion import MOTION
from web.signals.plain import sources_of
from web.signals.signal import Signal, Source

__all__ = [
    "COMPARED",
    "INDEX",
    "NAMED",
    "NAMED_SOURCES",
    "PLACES",
    "SIGNALS",
    "UNITS",
    "Signal",
    "Source",
    "describe",
    "described",
    "topics_for",
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
PLACES: dict[str, Place] = {
    signal.name: Place(source.topic, source, k, source.named_columns)
    for source in _SOURCES
    for k, signal in enumerate(source.signals)
}
"""The source of each signal; a column of a member is named `MEMBER/COLUMN`."""


def topics_for(wanted: Set[str]) -> frozenset[str]:
    """Return the topics from which the values of these signals are computed."""
    places = [PLACES[name] for name in wanted]
    inputs = {name for place in places for name in place.source.inputs}
    its = frozenset(place.topic for place in places)
    return its | topics_for(inputs) if inputs else its


def describe() -> dict[str, object]:
    """Return the names, units and groups that the page needs to list the signals."""
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
