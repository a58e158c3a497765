"""What a report needs of a log, read once: columns of numbers, texts, events, what is missing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flight_log.attached import json_value, literal_value
from flight_log.column_spool import ColumnSpool, gather
from flight_log.message_times import common_stamps, gaps, seconds_since
from flight_log.topic_columns import ColumnReader, text_fields
from quadrotor.errors import LogFormatError
from quadrotor.parameters import ParameterValue

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]


def _axes(stem: str, axes: str = "xyz") -> tuple[str, ...]:
    return tuple(f"{stem}.{axis}" for axis in axes)


ODOMETRY = (
    *_axes("pose.pose.position"),
    *_axes("pose.pose.orientation", "wxyz"),
    *_axes("twist.twist.linear"),
)
WANTED: dict[str, tuple[str, ...]] = {
    "state": ODOMETRY,
    "truth": ODOMETRY,
    "tracker_pose": (*_axes("pose.position"), *_axes("pose.orientation", "wxyz")),
    "reference": (*_axes("position"), "yaw"),
    "actuators": ("thrust", *(f"motor_references[{k}]" for k in range(4)), "scaling"),
    "estimator": ("mass", "mass_variance", "measurement_age", "estimator"),
    "status": (
        "mode",
        "behavior",
        "armed",
        "airborne",
        "tick_rate",
        "lateness_p99",
        "lateness_max",
        "missed_share",
        "overruns",
        "missed_frames",
        "damaged_frames",
    ),
    "battery": ("voltage",),
    "link_status": ("loss", "round_trip", "outages", "outage_total"),
    "bench_reading": ("force", "torque", "speed"),
    "experiment_status": ("name", "run_id", "proposal", "decision"),
}
"""Numbers and texts by topic; of every other topic the times alone are read."""
LINES = ("/events", "/marks", "/parameter_changes")
"""Topics of which every message is a line of its own."""
IMU = {"imu": (*_axes("linear_acceleration"), *_axes("angular_velocity"))}
"""Read when the figures need it."""
MOST_LINES = 2000
MOST_BYTES = 180_000_000
"""Largest size of stamps and values: above an hour's flight, and ten million bare stamps."""
ON_CHANGE = ("events", "marks", "parameter_changes", "parameter_events", "joy", "stick")
"""Silent by nature: no gap of theirs is one."""
WARNING = 30  # level of rcl_interfaces/Log


class Line(NamedTuple):
    """Something that happened: `kind` is event, warning, mark or parameter."""

    time: float  # s since the first message
    kind: str
    text: str
    who: str = ""


@dataclass
class Series:
    """N messages of one topic in the order of their time.

    `texts` tells from which time on a text was what.
    """

    type_name: str
    time: Array  # (N,) s since the log's first message
    numbers: dict[str, Floats] = field(default_factory=dict)  # (N,) each
    texts: dict[str, list[tuple[float, str]]] = field(default_factory=dict)

    def rows(self, names: tuple[str, ...]) -> Floats:
        """Return (N, len(names)); NaN where the log has no such number."""
        nothing = np.full(len(self.time), np.nan, np.float32)
        return np.stack([self.numbers.get(n, nothing) for n in names], axis=1)

    def take(self, names: tuple[str, ...]) -> Floats:
        """Return the columns as `rows` does, and free them one after the other."""
        out = np.full((len(self.time), len(names)), np.nan, np.float32)
        for k, name in enumerate(names):
            if name in self.numbers:
                out[:, k] = self.numbers.pop(name)
        return out

    @property
    def gaps(self) -> list[tuple[float, float]]:
        """Start and length (s) of its silences."""
        return [
            (float(self.time[k]), float(self.time[k + 1] - self.time[k])) for k in gaps(self.time)
        ]


@dataclass
class RunLog:
    """One log. Times are s since its first message."""

    path: Path
    vehicle: str
    run: dict[str, str]  # metadata `quadlab.run`
    recovered: dict[str, str]  # metadata `quadlab.recovered`, empty for a log that never was torn
    attachments: dict[str, bytes]
    start_ns: int
    duration: float  # s
    topics: dict[str, Series]  # by name without the vehicle's
    lines: list[Line]
    problems: list[str]  # what of the file could not be read
    changes: dict[str, ParameterValue]  # parameters as they were last changed

    def has(self, *topics: str) -> bool:
        return all(topic in self.topics for topic in topics)

    def experiment_text(self, path: str) -> str:
        """Return the last one of `experiment_status` that was not empty, while it told of this run.

        The station goes on telling how its last experiment stands, in later runs' logs too.
        """
        run_id = self.run.get("run_id") or self.path.stem
        own = [
            (start, end)
            for start, end, text in self._stretches("experiment_status", "run_id", math.inf)
            if text == run_id
        ]
        told = self._stretches("experiment_status", path, math.inf)
        return next(
            (
                text
                for start, end, text in reversed(told)
                if any(start < own_end and own_start < end for own_start, own_end in own)
            ),
            "",
        )

    def spans(self, topic: str, path: str) -> list[tuple[float, float, str]]:
        """Return start, end (s) and text of the topic's stretches."""
        return self._stretches(topic, path, self.duration)

    def _stretches(self, topic: str, path: str, end: float) -> list[tuple[float, float, str]]:
        """Return the stretches of a text; the last one lasts until `end`, s."""
        told = self.topics[topic].texts.get(path, []) if topic in self.topics else []
        ends = [time for time, _ in told[1:]] + [end]
        return [(t, until, text) for (t, text), until in zip(told, ends, strict=False) if text]

    def json_attachment(self, name: str) -> Any:
        """Return the attachment; None when there is none, or it is not JSON."""
        try:
            return json_value(self.attachments[name])
        except (KeyError, ValueError):
            return None


def read_run(path: Path, wanted: Mapping[str, tuple[str, ...]] = WANTED) -> RunLog:
    """Raise StorageError or LogFormatError when there is nothing in it to report on."""
    reader = ColumnReader(path, LINES, wanted)
    spools = gather(reader, MOST_LINES, most_bytes=MOST_BYTES)
    if not spools:
        tear, unread = reader.log.tear, next(iter(reader.problems.items()), None)
        why = f"{unread[0]}: {unread[1]}" if unread else f"it {tear or 'has no message'}"
        raise LogFormatError(f"{path.name} has nothing to report on: {why}")
    space = _namespace(spools)
    stamps = {topic: common_stamps(one.log_ns, one.publish_ns) for topic, one in spools.items()}
    start_ns = min(int(one.min()) for one in stamps.values())
    topics: dict[str, Series] = {}
    lines: list[Line] = []
    changes: dict[str, ParameterValue] = {}
    for topic in sorted(spools):
        spool = spools.pop(topic)
        time: Array = seconds_since(stamps.pop(topic), start_ns)
        spool.give_up_stamps()
        if topic.endswith(LINES):
            lines += _lines(topic, spool, time, changes)
        known = (one.time for one in topics.values() if np.array_equal(one.time, time))
        name = topic.removeprefix(f"{space}/").lstrip("/")
        topics[name] = _series(spool, next(known, time))
    log = reader.log
    problems = [f"{topic.lstrip('/')}: {why}" for topic, why in reader.problems.items()]
    if log.tear:
        problems.insert(0, f"the file is torn: it {log.tear}; what stands before is reported")
    if log.damaged_chunks:
        problems.insert(0, f"{log.damaged_chunks} damaged pieces of the file were passed over")
    run = log.metadata.get("quadlab.run", {})
    return RunLog(
        path,
        space.strip("/") or run.get("vehicle", ""),
        run,
        log.metadata.get("quadlab.recovered", {}),
        log.attachments,
        start_ns,
        max(float(one.time[-1]) for one in topics.values()),
        topics,
        sorted(lines, key=lambda line: line.time),
        problems,
        changes,
    )


def parameters_of(log: RunLog) -> dict[str, ParameterValue]:
    """Return name → value at the start; a station's own begin with `station.`. Empty: not
    recorded.
    """
    read = log.json_attachment("parameters.json")
    if not isinstance(read, Mapping):
        return {}
    if "vehicle" not in read and "station" not in read:
        return _plain(read)
    values = _plain(read["vehicle"]) if isinstance(read.get("vehicle"), Mapping) else {}
    station = read.get("station")
    for name, value in (_plain(station) if isinstance(station, Mapping) else {}).items():
        values[name if name.startswith("station.") else f"station.{name}"] = value
    return values


def _plain(values: Mapping[str, Any]) -> dict[str, ParameterValue]:
    return {str(k): v for k, v in values.items() if isinstance(v, bool | int | float | str)}


def _namespace(spools: Mapping[str, ColumnSpool]) -> str:
    """Return the namespace of the vehicle whose log it is: where the state is, else most of the
    messages.
    """
    counts: dict[str, int] = {}
    for topic, one in spools.items():
        space, _, name = topic.rpartition("/")
        counts[space] = counts.get(space, 0) + len(one) + (10**12 if name == "state" else 0)
    return max(counts, key=lambda space: counts[space])


def _series(spool: ColumnSpool, time: Array) -> Series:
    """Return the series in order of `time`, (N,) s."""
    texts = {
        name: sorted((float(time[index]), text) for index, text in told)
        for name, told in spool.texts.items()
    }
    numbers = spool.numbers
    if len(time) > 1 and not (time[1:] >= time[:-1]).all():
        if numbers:
            order = np.argsort(time, kind="stable")
            numbers = {name: one[order] for name, one in numbers.items()}
            del order
        time.sort()
    return Series(spool.type_name, time, numbers, texts)


def _lines(
    topic: str, spool: ColumnSpool, time: Array, changes: dict[str, ParameterValue]
) -> list[Line]:
    found: list[Line] = []
    marks: dict[str, Line] = {}  # of the messages of one id the newest text counts
    for t, payload in zip(time.tolist(), spool.payloads, strict=False):
        said = text_fields(payload, spool.type_name)
        who = str(said.get("requester", ""))
        if topic.endswith("/events"):
            kind = "warning" if int(said.get("level", 0)) >= WARNING else "event"
            found.append(Line(t, kind, str(said.get("msg", "")), who))
        elif topic.endswith("/marks"):
            number = str(said.get("id") or len(marks))
            at = marks[number].time if number in marks else t
            marks[number] = Line(at, "mark", str(said.get("text", "")), who)
        else:
            name, new = str(said.get("name", "")), said.get("new_value", "")
            changes[name] = _value(str(new))
            text = f"{name}: {said.get('old_value', '')} → {new}"
            found.append(Line(t, "parameter", text, who))
    left = len(time) - MOST_LINES
    if left > 0:
        found.append(Line(float(time[MOST_LINES]), "event", f"{left} more lines not listed"))
    return [*found, *marks.values()]


def _value(text: str) -> ParameterValue:
    try:
        value = literal_value(text)
    except ValueError:
        return text
    return value if isinstance(value, bool | int | float | str) else text
