"""Timeline of a run: events, marks, parameter changes, behaviors, moments to align at."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt

from bearing_sim.beacons import parse_layout
from flight_log.attached import parameters_of
from flight_log.run import Series
from quadrotor.errors import QuadlabError

WHOLE = ("/events", "/marks", "/parameter_changes")
"""Topics of which every message is a separate line."""
MOST_LINES = 5000
"""Largest number of lines of each kind; of a log with more, the first ones are shown."""
SPANS = {"mode": ("status", "mode"), "behavior": ("status", "behavior")}
_WORDS = ("text", "label", "words", "note", "notes", "msg", "message", "description", "name")
_PEOPLE = ("requester", "operator", "author", "who", "by", "person")
_WARNING = 30  # rcl_interfaces/Log
SIGHT_LASTS = 0.3
"""Time in s after which a frame of bearings is no sight of its beacons any more."""
NEIGHBOUR_RATE = 10.0
"""Hz, at most, of the bearings to other vehicles that the 3D view draws."""
LAYOUTS = ("station.bearings.layout", "bearings.layout", "beacons.layout")

Times = npt.NDArray[np.float64]
Moment = dict[str, Any]


def lines_of(series: Series) -> list[dict[str, Any]]:
    """Return each message of one of WHOLE with its time t, text, requester and other fields."""
    found = []
    for t, fields in islice(series.lines(MOST_LINES), MOST_LINES):
        texts = {k: v for k, v in fields.items() if isinstance(v, str) and v}
        words = next((texts[name] for name in _WORDS if name in texts), "")
        who = next((texts[name] for name in _PEOPLE if name in texts), "")
        found.append({"t": round(t, 4), "text": words, "who": who, "fields": fields})
    return found


def cut(topics: Mapping[str, Series]) -> dict[str, str]:
    """Return a line for each of WHOLE that has more than MOST_LINES messages, by topic."""
    return {
        topic: f"only the first {MOST_LINES} of {len(series)} messages are listed"
        for topic, series in topics.items()
        if f"/{topic}".endswith(WHOLE) and len(series) > MOST_LINES
    }


def as_events(lines: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [
        {
            "t": line["t"],
            "text": line["text"],
            "warn": int(line["fields"].get("level", 0)) >= _WARNING,
        }
        for line in lines
    ]


def as_marks(lines: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return one entry a mark, with the newest text of its messages, even an empty one."""
    found: dict[str, dict[str, Any]] = {}
    for number, line in enumerate(lines):
        key = str(line["fields"].get("id") or number)
        mark = found.setdefault(key, {"t": line["t"], "text": "", "who": line["who"]})
        mark["text"] = line["text"]
    return list(found.values())


def as_changes(lines: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the parameter changes with their values."""
    return [
        {
            "t": line["t"],
            "name": str(line["fields"].get("name", "")),
            "who": line["who"],
            "old": line["fields"].get("old_value"),
            "new": line["fields"].get("new_value"),
        }
        for line in lines
    ]


def spans(changes: list[tuple[float, str]], end: float) -> list[dict[str, Any]]:
    """Return the spans of equal text, the last one up to `end`."""
    ends = [t for t, _ in changes[1:]] + [end]
    return [
        {"from": round(t, 4), "to": round(max(t, stop), 4), "text": text}
        for (t, text), stop in zip(changes[:MOST_LINES], ends, strict=False)
        if text
    ]


def rises(times: Times, values: npt.NDArray[np.float32]) -> list[float]:
    """Return the times at which a flag became true; the first one if it was true at the start."""
    on = values > 0.5
    before = np.concatenate([[False], on[:-1]])
    return [round(float(t), 4) for t in times[on & ~before]]


def moments(
    armed: list[float],
    airborne: list[float],
    marks: list[dict[str, Any]],
    behaviors: list[dict[str, Any]],
) -> list[Moment]:
    """Return the moments at which two runs can be aligned: kind, label, t (s)."""
    found: list[Moment] = [{"kind": "start", "label": "start of recording", "t": 0.0}]
    found += _numbered("arming", "arming", armed)
    found += _numbered("take_off", "take-off", airborne)
    for k, mark in enumerate(marks[:200], 1):
        label = f"mark: {mark['text']}" if mark["text"] else f"mark {k}"
        found.append({"kind": "mark", "label": label, "t": mark["t"]})
    seen: dict[str, int] = {}
    for one in behaviors[:500]:
        name = one["text"]
        seen[name] = seen.get(name, 0) + 1
        label = name.replace("_", " ") + (f" {seen[name]}" if seen[name] > 1 else "")
        found.append({"kind": f"behavior:{name}", "label": label, "t": one["from"]})
    return found


def parameters_in_json(attachment: bytes | None) -> dict[str, Any]:
    """Return name → value at the start; a number that JSON lacks becomes a text."""
    return {
        k: str(v) if isinstance(v, float) and not math.isfinite(v) else v
        for k, v in parameters_of(attachment).items()
    }


def beacons_of(
    parameters: Mapping[str, Any], changes: list[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Return the layouts with the time when each came into force: t, beacons (id, x, y, z)."""
    name = next((one for one in LAYOUTS if one in parameters), None)
    if name is None:
        return []
    texts = [(0.0, parameters[name])]
    texts += [(one["t"], one["new"]) for one in changes if one["name"] == name]
    found = []
    for t, text in texts:
        with contextlib.suppress(QuadlabError, ValueError, TypeError, AttributeError):
            layout = parse_layout(text)
            rows = [
                [int(id), *(float(x) for x in place)]
                for id, place in zip(layout.ids, layout.positions_w, strict=True)
            ]
            found.append({"t": t, "beacons": rows})
    return found


def sights_of(bearings: Series | None) -> list[dict[str, Any]]:
    """Return the changes of the beacons in sight: t, ids, and sigma (rad) of the bearings."""
    names = [] if bearings is None else [n for n in bearings.names if n.startswith("beacon_ids[")]
    if bearings is None or not len(bearings) or "sigma" not in bearings:
        return []
    rows = bearings.rows([*names, "sigma"])
    alike = (rows[1:] == rows[:-1]) | (np.isnan(rows[1:]) & np.isnan(rows[:-1]))
    begins = np.append(True, ~alike.all(axis=1))
    late = np.append(np.diff(bearings.time) > SIGHT_LASTS, True)
    begins[1:] |= late[:-1]
    found: list[dict[str, Any]] = [
        {"t": float(t), "ids": [int(id) for id in ids if not np.isnan(id)], "sigma": float(sigma)}
        for t, (*ids, sigma) in zip(bearings.time[begins], rows[begins], strict=True)
    ]
    found += [{"t": float(t) + SIGHT_LASTS, "ids": [], "sigma": 0.0} for t in bearings.time[late]]
    return sorted(found, key=lambda one: one["t"])[:MOST_LINES]


def neighbours_of(bearings: Series | None) -> list[Moment]:
    """Return what a vehicle saw of others, at most NEIGHBOUR_RATE times a second: t, sigma (rad)
    and rows of the other's number and its bearing, a unit vector in body axes.
    """
    ids = [] if bearings is None else [n for n in bearings.names if n.startswith("beacon_ids[")]
    if bearings is None or not len(bearings) or "sigma" not in bearings:
        return []
    slots = np.floor(bearings.time * NEIGHBOUR_RATE)
    picked = np.append(True, slots[1:] != slots[:-1]) | np.append(np.diff(slots) > 1.0, True)
    paths = [f"bearings[{k}].{axis}" for k in range(len(ids)) for axis in "xyz"]
    rows = bearings.rows(["sigma", *ids, *paths])[picked][:MOST_LINES]
    found: list[Moment] = []
    for t, (sigma, *numbers) in zip(bearings.time[picked], rows.tolist(), strict=False):
        seen, axes = numbers[: len(ids)], np.reshape(numbers[len(ids) :], (len(ids), 3)).round(5)
        pairs = zip(seen, axes.tolist(), strict=True)
        told = [[int(id), *axis] for id, axis in pairs if np.isfinite([id, *axis]).all()]
        found.append({"t": float(t), "sigma": sigma, "seen": told})
    return found


def _numbered(kind: str, label: str, times: list[float]) -> list[Moment]:
    return [
        {"kind": kind, "label": label if k == 0 else f"{label} {k + 1}", "t": t}
        for k, t in enumerate(times[:50])
    ]
