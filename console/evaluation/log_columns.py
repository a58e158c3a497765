"""Some topics of a log as columns over time, and the parameters it was flown with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from flight_log.attached import json_value
from flight_log.reader import read_attachments
from flight_log.topic_columns import ColumnReader
from quadrotor.errors import LogFormatError
from quadrotor.parameters import ParameterValue

Array = npt.NDArray[np.float64]

Words = list[tuple[float, str]]
"""(s, text from then on)."""


@dataclass(slots=True)
class TopicColumns:
    """N messages of one topic, by the stamps of their source."""

    time: Array  # (N,) s
    numbers: dict[str, Array]  # (N,) each
    words: dict[str, Words] = field(default_factory=dict)

    def table(self, names: tuple[str, ...], start: float, end: float) -> Array:
        """Return (M, len(names)) of start <= t <= end; NaN where the log has no such number."""
        inside = (self.time >= start) & (self.time <= end)
        nothing = np.full(len(self.time), np.nan)
        columns = [self.numbers.get(name, nothing)[inside] for name in names]
        return np.stack(columns, axis=1)

    def first(self, name: str, *words: str) -> float:
        """Return the time (s) at which a text first is one of `words`; NaN when it never is."""
        return next((t for t, text in self.words.get(name, []) if text in words), float("nan"))


def read_columns(
    log: Path, vehicle: str, wanted: Mapping[str, tuple[str, ...]], optional: tuple[str, ...] = ()
) -> dict[str, TopicColumns]:
    """Return the fields of each topic, named without namespace. Raises LogFormatError for missing
    ones.

    Args:
        optional: topics that may be missing; they have no messages then.
    """
    batches: dict[str, list[tuple[Array, dict[str, Array]]]] = {topic: [] for topic in wanted}
    words: dict[str, dict[str, Words]] = {topic: {} for topic in wanted}
    for batch in ColumnReader(log, wanted=wanted):
        for columns in batch.columns:
            topic = columns.topic.rsplit("/", 1)[-1]
            if topic not in wanted or columns.topic != f"/{vehicle}/{topic}":
                continue
            time: Array = columns.publish_ns.astype(float) * 1e-9
            batches[topic].append((time, {k: v.astype(float) for k, v in columns.numbers.items()}))
            for name, changes in columns.texts.items():
                at = [(float(time[index]), text.lower()) for index, text in changes]
                words[topic].setdefault(name, []).extend(at)
    missing = [topic for topic, found in batches.items() if not found and topic not in optional]
    if missing:
        raise LogFormatError(
            f"{log.name} has no messages of {', '.join(missing)} of {vehicle}: "
            "it cannot be judged without them"
        )
    out = {}
    for topic, found in batches.items():
        time: Array = np.concatenate([t for t, _ in found] or [np.empty(0)])
        order = np.argsort(time, kind="stable")
        numbers = {
            name: np.concatenate(
                [values.get(name, np.full(len(t), np.nan)) for t, values in found]
            )[order]
            for name in dict.fromkeys(name for _, values in found for name in values)
        }
        out[topic] = TopicColumns(time[order], numbers, words[topic])
    return out


@dataclass(frozen=True, slots=True)
class FlownParameters:
    """What the log began with.

    Attributes:
        vehicle: its own parameters. truth: those of the simulator, without prefix; empty when the
            log has none, as of a real vehicle.
    """

    vehicle: dict[str, ParameterValue]
    truth: dict[str, ParameterValue]


def read_parameters(log: Path) -> FlownParameters:
    """Read the parameters of a simulated flight, or of a station's run. Raises LogFormatError
    without them.
    """
    try:
        values = json_value(read_attachments(log).get("parameters.json", b"{}"))
    except ValueError as error:
        raise LogFormatError(f"{log.name}: its parameters cannot be read: {error}") from None
    if isinstance(values, dict) and isinstance(values.get("vehicle"), dict):
        values = values["vehicle"]
    if not isinstance(values, dict) or "model.mass" not in values:
        raise LogFormatError(f"{log.name} has no parameters of the vehicle in it")
    prefix = "simulator."
    truth = {k.removeprefix(prefix): v for k, v in values.items() if k.startswith(prefix)}
    return FlownParameters(values, truth)
