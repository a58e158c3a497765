"""The signals of a run: those of the live page by the same names, then every number of the log.

Most are a column of the log and a factor: angles are stored in rad and shown in degrees. What is
made of several columns is stored as a column of its own, `@` and its name.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from flight_log.run import Series
from web.signals import NAMED_SOURCES, Signal, Source

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Recorded:
    """A signal of a run; `known` ones have words and a unit, the others their path."""

    name: str
    label: str
    unit: str
    group: str
    topic: str
    column: str
    factor: float = 1.0
    known: bool = True


def signals_of(
    columns: Mapping[str, Collection[str]], members: Mapping[str, str]
) -> Iterator[Recorded]:
    """Yield the signals of a log.

    Args:
        columns: topic without the vehicle's namespace → its columns, the derived ones among them.
        members: of `members_of`.
    """
    for source in NAMED_SOURCES:
        for signal, column, factor in _places(source, members):
            if column in columns.get(source.topic, ()):
                yield _recorded(signal, source.topic, column, factor)
    for topic, paths in columns.items():
        for path in paths:
            if not path.startswith("@"):
                yield Recorded(f"{topic}/{path}", path, "", topic, topic, path, known=False)


def members_of(topics: Mapping[str, Series]) -> dict[str, str]:
    """Return where each estimator of the topic `comparison` is: `vehicle` → `estimators[0].`."""
    compared = topics.get("comparison")
    return {
        changes[0][1]: path.removesuffix("name")
        for path, changes in (compared.texts if compared else {}).items()
        if path.endswith(".name") and len(changes) == 1
    }


def derived(topics: Mapping[str, Series], members: Mapping[str, str]) -> dict[tuple[str, str], Any]:
    """Return what is made of several columns, float32 (N,), by topic and column `@…`."""
    known: dict[str, tuple[Array, Array]] = {}  # times and values, by signal
    found = {}

    def input_at(times: Array, name: str) -> Array:
        return at(times, *known[name])

    with np.errstate(invalid="ignore", divide="ignore"):
        for source in NAMED_SOURCES:
            columns, series = _columns(source, members), topics.get(source.topic)
            if series is None or columns is None or not all(c in series for c in columns):
                continue
            if source.function is None:
                wanted = ((s.name, c, f) for s, c, f in _places(source, members) if s.name in _USED)
                known |= {
                    n: (series.time, series.values(c).astype(float) * f) for n, c, f in wanted
                }
            elif all(name in known for name in source.inputs):
                read = [series.values(column).astype(float) for column in columns]
                inputs = [input_at(series.time, name) for name in source.inputs]
                values = source.function(np, *read, *inputs)
                for signal, one in zip(source.signals, values, strict=True):
                    known[signal.name] = (series.time, one)
                    found[source.topic, f"@{signal.name}"] = one.astype(np.float32)
    return found


def at(times: Array, source_times: Array, values: npt.NDArray[np.floating]) -> Array:
    """Interpolate linearly between the samples of `values`; NaN outside of them."""
    if len(source_times) == 0:
        return np.full(len(times), np.nan)
    if len(times) == len(source_times) and np.array_equal(times, source_times):
        return values.astype(float)
    between: Array = np.interp(times, source_times, values.astype(float), left=np.nan, right=np.nan)
    return between


_USED = {name for source in NAMED_SOURCES for name in source.inputs}


def _columns(source: Source, members: Mapping[str, str]) -> list[str] | None:
    """Return the names a log has for a source's columns; None without its member."""
    if source.member and source.member not in members:
        return None
    below = members[source.member] if source.member else ""
    return [f"{below}{column}" for column in source.columns]


def _places(source: Source, members: Mapping[str, str]) -> list[tuple[Signal, str, float]]:
    """Return column and factor of each signal."""
    if source.function is not None:
        return [(signal, f"@{signal.name}", 1.0) for signal in source.signals]
    columns = _columns(source, members) or []
    return list(zip(source.signals, columns, source.factors, strict=False))


def _recorded(signal: Signal, topic: str, column: str, factor: float) -> Recorded:
    return Recorded(signal.name, signal.label, signal.unit, signal.group, topic, column, factor)


def as_json(signal: Recorded, constant: float | None) -> dict[str, Any]:
    """Return the signal for the page; `constant`: the only value it has."""
    fields: dict[str, Any] = {
        "name": signal.name,
        "label": signal.label,
        "unit": signal.unit,
        "group": signal.group,
        "known": signal.known,
    }
    if constant is not None:
        fields["constant"] = None if math.isnan(constant) else constant * signal.factor
    return fields
