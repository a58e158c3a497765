"""A replay's cache as it is written: what there is and where, columns with their levels, the track.

`index.json` (what there is and where), `columns.bin` (arrays one after the other) and `track.bin`
(web.replay.track) in one folder.
"""

from __future__ import annotations

from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from console.evaluation.explanation.explain import explain
from flight_log.attached import parameters_of
from flight_log.message_times import gaps
from flight_log.run import Run
from web.replay import timeline
from web.replay.pyramid import FACTOR, edges, level_sizes, pyramid
from web.replay.signals import as_json, derived, members_of, signals_of
from web.replay.track import PARTS, WIDTH, track

VERSION = 4
"""Of the cache; another one is built anew."""
MOST_COLUMNS = 4000
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
    """Args: `tell` is called with the share that is done, 0 to 1."""

    def __init__(self, run: Run, arrays: Arrays, folder: Path, tell: Any) -> None:
        self._run = run
        self._topics = run.topics
        self._arrays = arrays
        self._folder = folder
        self._tell = tell
        self._columns: dict[str, dict[str, Any]] = {}
        self._members = members_of(self._topics)
        self._fresh = derived(self._topics, self._members)

    def index(self) -> dict[str, Any]:
        """Write all arrays and the track; return what `index.json` is to hold."""
        run = self._run
        parameters = parameters_of(run.log.attachments.get("parameters.json"))
        findings = [one.as_json() for one in explain(self._topics, parameters)]
        # Topics of the same ticks share their times.
        times = {id(one.time): one.time for one in self._topics.values()}
        bases = {key: number for number, key in enumerate(times)}
        base_rows = [self._base(one) for one in times.values()]
        total = sum(len(one.names) for one in self._topics.values())
        done = 0
        left = MOST_COLUMNS
        for topic, series in self._topics.items():
            self._columns[topic] = {}
            names, left = series.names[:left], max(left - len(series.names), 0)
            for name in [*names, *(name for t, name in self._fresh if t == topic)]:
                self._columns[topic][name] = self._store(topic, name)
                done += 1
                self._tell(min(1.0, done / max(total, 1)))
        rate = self._write_track(run.duration)
        return {
            "version": VERSION,
            "start_ns": run.start_ns,
            "duration": run.duration,
            "namespace": run.space,
            "tear": run.log.tear,
            "damaged_chunks": run.log.damaged_chunks,
            "problems": run.log.problems,
            "bases": base_rows,
            "topics": {
                topic: {
                    "type": one.type_name,
                    "count": len(one),
                    "base": bases[id(one.time)],
                    "columns": self._columns[topic],
                }
                for topic, one in self._topics.items()
            },
            "signals": self._signals(),
            "findings": findings,
            "track": {"rate": rate, "width": WIDTH, "parts": {k: len(v) for k, v in PARTS.items()}},
            **self._timeline(run.duration),
        }

    def _base(self, times: Times) -> dict[str, Any]:
        sizes = [FACTOR**k for k in range(1, 1 + len(level_sizes(len(times))))]
        return {
            "count": len(times),
            "times": self._arrays.add(times),
            "edges": [self._arrays.add(edges(times, size)) for size in sizes],
            "gaps": gaps(times).tolist(),
        }

    def _store(self, topic: str, name: str) -> dict[str, Any]:
        """Store a column; return where it and its levels are, or its one value."""
        made = self._fresh.pop((topic, name), None)
        if made is None:
            constant = self._topics[topic].constant(name)
            if constant is not None:
                return {"constant": constant if np.isfinite(constant) else None}
        values = made if made is not None else self._topics[topic].values(name)
        place = self._arrays.add(values)
        return {
            "at": place,
            "levels": [self._arrays.add(np.stack(level)) for level in pyramid(values)],
        }

    def _signals(self) -> list[dict[str, Any]]:
        found = []
        for signal in signals_of(self._columns, self._members):
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
            if topic in self._topics:
                sources[topic] = (self._topics[topic].time, self._topics[topic].values)
        if "state" not in sources and "tracker_pose" in self._topics:
            sources["state"] = (self._topics["tracker_pose"].time, self._tracked)
        rate, rows = track(duration, sources)
        rows.tofile(self._folder / TRACK)
        return rate

    def _tracked(self, name: str) -> Floats:
        """Return the track; a log without estimates shows what the tracker saw."""
        return self._topics["tracker_pose"].values(name.removeprefix("pose."))

    def _timeline(self, duration: float) -> dict[str, Any]:
        lines: dict[str, list[dict[str, Any]]] = {end: [] for end in timeline.WHOLE}
        for topic, series in self._topics.items():
            for end in timeline.WHOLE:
                if f"/{topic}".endswith(end):
                    lines[end] += timeline.lines_of(series)
        marks = timeline.as_marks(lines["/marks"])
        changes = timeline.as_changes(lines["/parameter_changes"])
        parameters = timeline.parameters_in_json(self._run.log.attachments.get("parameters.json"))
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
                for topic, series in self._topics.items()
                if f"/{topic}" not in timeline.WHOLE
                for path in series.texts
                if (changed := self._text(topic, path)) and any(text for _, text in changed)
            },
        }

    def _text(self, topic: str, path: str) -> list[tuple[float, str]]:
        if topic not in self._topics:
            return []
        changes = self._topics[topic].changes(path)[: timeline.MOST_LINES]
        return [(round(time, 4), text) for time, text in changes]

    def _rises(self, name: str) -> list[float]:
        status = self._topics.get("status")
        if status is None or name not in status:
            return []
        return timeline.rises(status.time, status.values(name))
