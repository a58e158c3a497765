"""A replay's cache as it is written: what there is and where, columns with their levels, the track.

`index.json` (what there is and where), `columns.bin` (arrays one after the other) and `track.bin`
(web.replay.track) in one folder.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from flight_log.message_times import common_stamps, gaps, seconds_since
from flight_log.topic_columns import ColumnReader
from web.replay import derived, timeline
from web.replay.pyramid import FACTOR, edges, pyramid
from web.replay.signals import as_json, signals_of
from web.replay.spool import TopicSpool
from web.replay.track import PARTS, WIDTH, track

VERSION = 2
"""Of the cache; another one is built anew."""
INDEX, COLUMNS, TRACK = "index.json", "columns.bin", "track.bin"

Floats = npt.NDArray[np.float32]
Times = npt.NDArray[np.float64]


class Arrays:
    """Arrays one after the other in a file, each at a multiple of 8 bytes."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    def add(self, values: npt.NDArray[Any]) -> int:
        """Write an array and return where it begins."""
        place = self._file.tell()
        place += -place % 8
        self._file.seek(place)
        values.tofile(self._file)
        return place


class CacheWriter:
    """Args: `spools` by topic, `tell` is called with the share that is done, 0 to 1."""

    def __init__(
        self, spools: dict[str, TopicSpool], arrays: Arrays, folder: Path, tell: Any
    ) -> None:
        self._arrays = arrays
        self._folder = folder
        self._tell = tell
        self._space = _namespace(spools)
        self._spools = {_relative(topic, self._space): one for topic, one in spools.items()}
        self._times: dict[str, Times] = {}
        self._orders: dict[str, npt.NDArray[np.int64] | None] = {}
        self._bases: dict[str, int] = {}  # digest of the times → which base
        self._base_of: dict[str, int] = {}
        self._base_rows: list[dict[str, Any]] = []
        self._columns: dict[str, dict[str, Any]] = {}
        self._fresh: dict[tuple[str, str], npt.NDArray[Any]] = {}  # derived

    def index(self, reader: ColumnReader) -> dict[str, Any]:
        """Write all arrays and the track; what `index.json` is to hold."""
        start_ns = self._read_times()
        duration = max(float(times[-1]) for times in self._times.values())
        self._derive()
        total = sum(len(one.columns) for one in self._spools.values())
        done = 0
        for topic, spool in self._spools.items():
            self._columns[topic] = {}
            names = [*spool.columns, *(name for t, name in self._fresh if t == topic)]
            for name in names:
                self._columns[topic][name] = self._store(topic, name)
                done += 1
                self._tell(min(1.0, done / max(total, 1)))
        rate = self._write_track(duration)
        return {
            "version": VERSION,
            "start_ns": start_ns,
            "duration": duration,
            "namespace": self._space,
            "tear": reader.log.tear,
            "damaged_chunks": reader.log.damaged_chunks,
            "problems": reader.problems,
            "bases": self._base_rows,
            "topics": {
                topic: {
                    "type": one.type_name,
                    "count": one.count,
                    "base": self._base_of[topic],
                    "columns": self._columns[topic],
                }
                for topic, one in self._spools.items()
            },
            "signals": self._signals(),
            "track": {"rate": rate, "width": WIDTH, "parts": {k: len(v) for k, v in PARTS.items()}},
            **self._timeline(reader, duration),
        }

    def _read_times(self) -> int:
        """Read the seconds since the run's first message, in order; return the ns of that."""
        stamps = {}
        for topic, spool in self._spools.items():
            spool.close()
            stamps[topic] = common_stamps(*spool.stamps())
        start_ns = min(int(stamps[topic].min()) for topic in stamps)
        for topic in list(stamps):
            times = seconds_since(stamps.pop(topic), start_ns)
            is_sorted = bool((times[1:] >= times[:-1]).all())
            order = None if is_sorted else np.argsort(times, kind="stable")
            self._orders[topic] = order
            self._times[topic] = times if order is None else times[order]
            self._base_of[topic] = self._base(self._times[topic])
        return start_ns

    def _base(self, times: Times) -> int:
        """Return the base of a topic: topics of the same ticks share their times."""
        digest = hashlib.sha1(np.ascontiguousarray(times), usedforsecurity=False).hexdigest()
        if digest not in self._bases:
            self._bases[digest] = len(self._base_rows)
            sizes = [FACTOR**k for k in range(1, 1 + len(pyramid(times.astype(np.float32))))]
            self._base_rows.append(
                {
                    "count": len(times),
                    "times": self._arrays.add(times),
                    "edges": [self._arrays.add(edges(times, size)) for size in sizes],
                    "gaps": gaps(times).tolist(),
                }
            )
        return self._bases[digest]

    def _read(self, topic: str, name: str) -> Floats:
        values = self._spools[topic].columns[name].read()
        order = self._orders[topic]
        return values if order is None else values[order]

    def _derive(self) -> None:
        def column(topic: str) -> derived.Column:
            return lambda name: self._read(topic, name)

        def has(topic: str, names: tuple[str, ...]) -> bool:
            return topic in self._spools and self._spools[topic].columns.keys() >= set(names)

        found: dict[str, derived.Columns] = {}
        odometries = [topic for topic in ("state", "truth") if has(topic, derived.ODOMETRY)]
        for topic in odometries:
            found[topic] = derived.of_odometry(column(topic))
        if "state" in found and has("reference", (*derived.REFERENCE, "yaw")):
            error = derived.tracking(
                self._times["state"], column("state"), self._times["reference"], column("reference")
            )
            found["state"] |= error
        if len(odometries) == 2:
            found["truth"] |= derived.to_truth(
                self._times["truth"],
                column("truth"),
                found["truth"],
                self._times["state"],
                column("state"),
                found["state"],
            )
        for topic, columns in found.items():
            for name, values in columns.items():
                self._fresh[topic, name] = values.astype(np.float32)

    def _store(self, topic: str, name: str) -> dict[str, Any]:
        """Store a column; return where it and its levels are, or its one value."""
        made = self._fresh.pop((topic, name), None)
        if made is None:
            constant = self._spools[topic].columns[name].constant
            if constant is not None:
                return {"constant": constant if np.isfinite(constant) else None}
        values = made if made is not None else self._read(topic, name)
        place = self._arrays.add(values)
        return {
            "at": place,
            "levels": [self._arrays.add(np.stack(level)) for level in pyramid(values)],
        }

    def _signals(self) -> list[dict[str, Any]]:
        compared = self._spools.get("comparison")
        names = {
            path: changes[0][1]
            for path, changes in (compared.texts if compared else {}).items()
            if path.endswith(".name") and len(changes) == 1
        }
        found = []
        for signal in signals_of(self._columns, names):
            stored = self._columns[signal.topic][signal.column]
            constant = stored.get("constant", np.nan) if "constant" in stored else None
            row = as_json(signal, np.nan if "constant" in stored and constant is None else constant)
            found.append(
                {**row, "topic": signal.topic, "column": signal.column, "factor": signal.factor}
            )
        return found

    def _write_track(self, duration: float) -> float:
        sources: dict[str, Any] = {}
        for topic in PARTS:
            if topic in self._spools:
                sources[topic] = (
                    self._times[topic],
                    lambda name, topic=topic: self._read(topic, name),
                )
        if "state" not in sources and "tracker_pose" in self._spools:
            sources["state"] = (self._times["tracker_pose"], self._tracked)
        rate, rows = track(duration, sources)
        rows.tofile(self._folder / TRACK)
        return rate

    def _tracked(self, name: str) -> Floats:
        """Return the track; a log without estimates shows what the tracker saw."""
        return self._read("tracker_pose", name.removeprefix("pose."))

    def _timeline(self, reader: ColumnReader, duration: float) -> dict[str, Any]:
        lines: dict[str, list[dict[str, Any]]] = {end: [] for end in timeline.WHOLE}
        for topic, spool in self._spools.items():
            for end in timeline.WHOLE:
                if f"/{topic}".endswith(end):
                    lines[end] += timeline.lines_of(spool, self._times[topic], self._orders[topic])
        marks = timeline.as_marks(lines["/marks"])
        changes = timeline.as_changes(lines["/parameter_changes"])
        parameters = timeline.parameters_of(reader.log.attachments.get("parameters.json"))
        spans = {
            name: timeline.spans(self._text(topic, path), duration)
            for name, (topic, path) in timeline.SPANS.items()
        }
        return {
            "events": timeline.as_events(lines["/events"]),
            "marks": marks,
            "changes": changes,
            "parameters": parameters,
            "volume": timeline.volume_of(parameters),
            "beacons": timeline.beacons_of(parameters, changes),
            "spans": spans,
            "airborne": self._rises("airborne"),
            "moments": timeline.moments(
                self._rises("armed"), self._rises("airborne"), marks, spans["behavior"]
            ),
            "texts": {
                f"{topic}/{path}": changed
                for topic, spool in self._spools.items()
                if f"/{topic}" not in timeline.WHOLE
                for path in spool.texts
                if (changed := self._text(topic, path)) and any(text for _, text in changed)
            },
        }

    def _text(self, topic: str, path: str) -> list[tuple[float, str]]:
        if topic not in self._spools:
            return []
        changes = self._spools[topic].texts.get(path, [])[: timeline.MOST_LINES]
        order, times = self._orders[topic], self._times[topic]
        place = np.arange(len(times)) if order is None else np.argsort(order)
        return sorted((round(float(times[place[index]]), 4), text) for index, text in changes)

    def _rises(self, name: str) -> list[float]:
        if "status" not in self._spools or name not in self._spools["status"].columns:
            return []
        return timeline.rises(self._times["status"], self._read("status", name))


def _namespace(spools: dict[str, TopicSpool]) -> str:
    """Return the namespace of the vehicle whose run it is: where the state is, else most of the
    messages.
    """
    counts: dict[str, int] = {}
    for topic, spool in spools.items():
        space, _, name = topic.rpartition("/")
        counts[space] = counts.get(space, 0) + spool.count + (10**12 if name == "state" else 0)
    return max(counts, key=lambda space: counts[space])


def _relative(topic: str, space: str) -> str:
    return topic.removeprefix(f"{space}/") if topic.startswith(f"{space}/") else topic.lstrip("/")
