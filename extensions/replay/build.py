"""Parts of a replay that take long to compute from the log's columns: time line, findings, track.

They are stored in the folder of the log's columns (flight_log.columns) and are deleted with it:
`replay.json`, and `track.bin` (`track.py`). The job of `store.py` makes them.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from console.evaluation.findings import explain
from control.behaviors.parameters import flight_volume, keep_out
from extensions.replay import timeline
from extensions.replay.signals import derived, members_of, signals_of
from extensions.replay.track import PARTS, WIDTH, Source, track
from flight_log.attached import parameters_of
from flight_log.run import Run, read_run
from quadrotor.errors import StorageError

VERSION = 7
"""Version of the files; those of another version are made again."""
MOST_SIGNALS = 4000
INDEX, TRACK = "replay.json", "track.bin"
READING = 0.9  # share of the progress


def build_replay(log: Path, report: Callable[[float], None]) -> None:
    """Make the files for the replay of a log. Raises LogFormatError or StorageError."""
    run = read_run(log, lambda share: report(round(READING * share, 3)))
    if run.log.note:
        raise StorageError(f"the replay of {log.name} cannot be kept: {run.log.note}")
    try:
        rate, rows = _track(run)
        rows.tofile(run.log.folder / TRACK)
        index = {**_index(run), "track": _described(rate)}
        text = json.dumps(index, allow_nan=False, separators=(",", ":"))
        (run.log.folder / INDEX).write_text(text)
    except OSError as error:
        raise StorageError(
            f"the replay of {log.name} cannot be written: {error.strerror or error}"
        ) from error
    report(1.0)


def _index(run: Run) -> dict[str, Any]:
    topics = run.topics
    parameters = parameters_of(run.log.attachments.get("parameters.json"))
    members = members_of(topics)
    made = derived(topics, members)
    columns = {topic: [*one.names, *made.get(topic, ())] for topic, one in topics.items()}
    return {
        "version": VERSION,
        "identity": run.log.identity,
        "start_ns": run.start_ns,
        "duration": run.duration,
        "namespace": run.space,
        "tear": run.log.tear,
        "damaged_chunks": run.log.damaged_chunks,
        "problems": run.log.problems | timeline.cut(topics),
        "topics": {
            topic: {"type": one.type_name, "count": len(one)} for topic, one in topics.items()
        },
        "signals": [
            _with_constant(run, one) for one in islice(signals_of(columns, members), MOST_SIGNALS)
        ],
        "findings": [one.as_json() for one in explain(topics, parameters)],
        **_timeline(run),
    }


def _with_constant(run: Run, signal: dict[str, Any]) -> dict[str, Any]:
    """Return the signal, with its value if that never changes."""
    value = run.topics[signal["topic"]].constant(signal["column"])
    if value is None:
        return signal
    return {**signal, "constant": value * signal["factor"] if np.isfinite(value) else None}


def _described(rate: float) -> dict[str, Any]:
    return {"rate": rate, "width": WIDTH, "parts": {k: len(v) for k, v in PARTS.items()}}


def _track(run: Run) -> tuple[float, Any]:
    sources: dict[str, Source] = {
        topic: (run.topics[topic].time, run.topics[topic].values)
        for topic in PARTS
        if topic in run.topics
    }
    tracked = run.topics.get("tracker_pose")
    if "state" not in sources and tracked is not None:
        # A log without estimates shows the tracker's poses.
        sources["state"] = tracked.time, lambda name: tracked.values(name.removeprefix("pose."))
    return track(run.duration, sources)


def _timeline(run: Run) -> dict[str, Any]:
    lines: dict[str, list[dict[str, Any]]] = {end: [] for end in timeline.WHOLE}
    for topic, series in run.topics.items():
        for end in timeline.WHOLE:
            if f"/{topic}".endswith(end):
                lines[end] += timeline.lines_of(series)
    marks = timeline.as_marks(lines["/marks"])
    changes = timeline.as_changes(lines["/parameter_changes"])
    parameters = timeline.parameters_in_json(run.log.attachments.get("parameters.json"))
    spans = {
        name: timeline.spans(_text(run, topic, path), run.duration)
        for name, (topic, path) in timeline.SPANS.items()
    }
    armed, airborne = _rises(run, "armed"), _rises(run, "airborne")
    return {
        "events": timeline.as_events(lines["/events"]),
        "marks": marks,
        "changes": changes,
        "parameters": parameters,
        "volume": flight_volume(parameters.get),
        "boxes": [(*zip(b.low_w, b.high_w, strict=True),) for b in keep_out(parameters.get)],
        "beacons": timeline.beacons_of(parameters, changes),
        "sights": timeline.sights_of(run.topics.get("bearings")),
        "neighbours": timeline.neighbours_of(run.topics.get("neighbour_bearings")),
        "spans": spans,
        "airborne": airborne,
        "moments": timeline.moments(armed, airborne, marks, spans["behavior"]),
        "texts": {
            f"{topic}/{path}": changed
            for topic, series in run.topics.items()
            if f"/{topic}" not in timeline.WHOLE
            for path in series.texts
            if (changed := _text(run, topic, path)) and any(text for _, text in changed)
        },
    }


def _text(run: Run, topic: str, path: str) -> list[tuple[float, str]]:
    if topic not in run.topics:
        return []
    changes = run.topics[topic].changes(path)[: timeline.MOST_LINES]
    return [(round(time, 4), text) for time, text in changes]


def _rises(run: Run, name: str) -> list[float]:
    status = run.topics.get("status")
    if status is None or name not in status:
        return []
    return timeline.rises(status.time, status.values(name))
