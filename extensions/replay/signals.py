"""Signals of a run: those of the live page by the same names, then every number of the log.

Most are a column of the log times a factor: angles are stored in rad and shown in degrees. A signal
computed from several columns has a derived column, `@` and its name, computed when it is shown.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from flight_log.run import Series
from web.signals import NAMED_SOURCES
from web.signals.signal import Signal, Source

Derived = dict[str, tuple[Source, list[str], int]]
"""Derived columns by their names `@…`.

A value has the source, the names of its columns in this log, and the signal's place in it.
"""


def signals_of(
    columns: Mapping[str, Collection[str]], members: Mapping[str, str]
) -> Iterator[dict[str, object]]:
    """Yield the signals of a log in the form for the page, with their column and its factor.

    `known` ones have a label and a unit, the others their path.

    Args:
        columns: topic without the vehicle's namespace → its columns, including the derived ones.
        members: the result of `members_of`.
    """
    for source in NAMED_SOURCES:
        for signal, column, factor in _places(source, members):
            if column in columns.get(source.topic, ()):
                yield {
                    "name": signal.name,
                    "label": signal.label,
                    "unit": signal.unit,
                    "group": signal.group,
                    "known": True,
                    "topic": source.topic,
                    "column": column,
                    "factor": factor,
                }
    for topic, paths in columns.items():
        for path in paths:
            if not path.startswith("@"):
                yield {
                    "name": f"{topic}/{path}",
                    "label": path,
                    "unit": "",
                    "group": topic,
                    "known": False,
                    "topic": topic,
                    "column": path,
                    "factor": 1.0,
                }


def members_of(topics: Mapping[str, Series]) -> dict[str, str]:
    """Return each estimator's place in the topic `comparison`: `vehicle` → `estimators[0].`."""
    compared = topics.get("comparison")
    return {
        changes[0][1]: path.removesuffix("name")
        for path, changes in (compared.texts if compared else {}).items()
        if path.endswith(".name") and len(changes) == 1
    }


def derived(topics: Mapping[str, Series], members: Mapping[str, str]) -> dict[str, Derived]:
    """Return the columns derived from several columns in this log, by topic."""
    known: set[str] = set()
    found: dict[str, Derived] = {}
    for source in NAMED_SOURCES:
        columns, series = _columns(source, members), topics.get(source.topic)
        if series is None or columns is None or not all(c in series for c in columns):
            continue
        if all(name in known for name in source.inputs):
            known.update(signal.name for signal in source.signals)
            if source.function is not None:
                made = {
                    f"@{one.name}": (source, columns, k) for k, one in enumerate(source.signals)
                }
                found.setdefault(source.topic, {}).update(made)
    return found


def _columns(source: Source, members: Mapping[str, str]) -> list[str] | None:
    """Return the names of a source's columns in the log; None if its member is missing."""
    if source.member and source.member not in members:
        return None
    below = members[source.member] if source.member else ""
    return [f"{below}{column}" for column in source.columns]


def _places(source: Source, members: Mapping[str, str]) -> list[tuple[Signal, str, float]]:
    """Return the signals of a source, each with its column and factor."""
    if source.function is not None:
        return [(signal, f"@{signal.name}", 1.0) for signal in source.signals]
    columns = _columns(source, members) or []
    return list(zip(source.signals, columns, source.factors, strict=False))
