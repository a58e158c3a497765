"""The content of a log for a report, read once: columns of numbers, texts, events and gaps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flight_log import run
from flight_log.attached import json_value, parameters_of
from flight_log.index import RECOVERED_METADATA
from flight_log.run import Series
from flight_log.writer import RUN_METADATA
from quadrotor.parameter_description import ParameterValue

Floats = npt.NDArray[np.float32]


LINES = ("/events", "/marks", "/parameter_changes")
"""Topics whose messages are single lines."""
MOST_LINES = 2000
ON_CHANGE = ("events", "marks", "parameter_changes", "joy", "stick")
"""Topics that are published only on change, and so have no gaps."""
WARNING = 30  # level of rcl_interfaces/Log


class Line(NamedTuple):
    """An event in the log: `kind` is event, warning, mark or parameter."""

    time: float  # s since the first message
    kind: str
    text: str
    who: str = ""


@dataclass
class RunLog:
    """One log. Times are s since its first message."""

    path: Path
    vehicle: str
    run: dict[str, str]  # metadata `quadlab.run`
    recovered: dict[str, str]  # metadata `quadlab.recovered`, empty for an intact log
    attachments: dict[str, bytes]
    start_ns: int
    duration: float  # s
    topics: dict[str, Series]  # by name, without the vehicle's
    lines: list[Line]
    problems: list[str]  # parts of the file that could not be read
    changes: dict[str, ParameterValue]  # last values of changed parameters

    def has(self, *topics: str) -> bool:
        return all(topic in self.topics for topic in topics)

    def experiment_text(self, path: str) -> str:
        """Return the last text of an `experiment_status` field of this run that was not empty.

        The station keeps publishing the status of its last experiment, also during later runs.
        """
        run_id = self.run.get("run_id") or self.path.stem
        own = [
            (start, end)
            for start, end, text in self._stretches("experiment_status", "run_id", math.inf)
            if text == run_id
        ]
        stretches = self._stretches("experiment_status", path, math.inf)
        return next(
            (
                text
                for start, end, text in reversed(stretches)
                if any(start < own_end and own_start < end for own_start, own_end in own)
            ),
            "",
        )

    def spans(self, topic: str, path: str) -> list[tuple[float, float, str]]:
        """Return start, end (s) and text of the intervals between the topic's changes."""
        return self._stretches(topic, path, self.duration)

    def _stretches(self, topic: str, path: str, end: float) -> list[tuple[float, float, str]]:
        """Return the intervals of a text signal; the last one lasts until `end` (s)."""
        changes = self.topics[topic].changes(path) if topic in self.topics else []
        ends = [time for time, _ in changes[1:]] + [end]
        return [(t, until, text) for (t, text), until in zip(changes, ends, strict=False) if text]

    @property
    def parameters(self) -> dict[str, ParameterValue]:
        """Return name → value at the start; the station's own begin with `station.`."""
        return parameters_of(self.attachments.get("parameters.json"))

    def json_attachment(self, name: str) -> Any:
        """Return the attachment, or None when it is missing or not JSON."""
        try:
            return json_value(self.attachments[name])
        except (KeyError, ValueError):
            return None


def read_run(path: Path) -> RunLog:
    """Read a log for a report. Raises StorageError or LogFormatError when there is nothing to
    report.
    """
    found = run.read_run(path)
    lines: list[Line] = []
    changes: dict[str, ParameterValue] = {}
    for topic, series in sorted(found.topics.items()):
        if f"/{topic}".endswith(LINES):
            lines += _lines(topic, series, changes)
    log = found.log
    problems = [f"{topic.lstrip('/')}: {why}" for topic, why in log.problems.items()]
    if log.note:
        problems.append(log.note)
    if log.tear:
        problems.insert(0, f"the file is torn: it {log.tear}; the part before that is reported")
    if log.damaged_chunks:
        problems.insert(0, f"{log.damaged_chunks} damaged pieces of the file were skipped")
    metadata = log.metadata.get(RUN_METADATA, {})
    return RunLog(
        path=path,
        vehicle=found.space.strip("/") or metadata.get("vehicle", ""),
        run=metadata,
        recovered=log.metadata.get(RECOVERED_METADATA, {}),
        attachments=log.attachments,
        start_ns=found.start_ns,
        duration=found.duration,
        topics=found.topics,
        lines=sorted(lines, key=lambda line: line.time),
        problems=problems,
        changes=changes,
    )


def _lines(topic: str, series: Series, changes: dict[str, ParameterValue]) -> list[Line]:
    found: list[Line] = []
    marks: dict[str, Line] = {}  # only the newest text of each id counts
    for t, message in series.lines(MOST_LINES):
        who = str(message.get("requester", ""))
        if topic.endswith("events"):
            kind = "warning" if int(message.get("level", 0)) >= WARNING else "event"
            found.append(Line(t, kind, str(message.get("msg", "")), who))
        elif topic.endswith("marks"):
            number = str(message.get("id") or len(marks))
            at = marks[number].time if number in marks else t
            marks[number] = Line(at, "mark", str(message.get("text", "")), who)
        else:
            name, new = str(message.get("name", "")), message.get("new_value", "")
            changes[name] = new
            text = f"{name}: {message.get('old_value', '')!r} → {new!r}"
            found.append(Line(t, "parameter", text, who))
    left = len(series) - MOST_LINES
    if left > 0:
        text = f"{left} more lines not listed"
        found.append(Line(float(series.time[MOST_LINES]), "event", text))
    return [*found, *marks.values()]
