"""Recording of a flight for viser: what the 3D view of the page would have shown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from console.atomic_file import replacing
from flight_log import read_attachments, read_log, summarize
from flight_log.attached import json_value, logged_value
from quadrotor.errors import os_errors
from vehicle_link.messages import decode
from vehicle_link.messages.records import ParameterChange
from vehicle_link.topics import TOPICS
from web.latest import Live
from web.parameters.follower import BEARINGS, bearing_values, show_bearings
from web.view.scene import Scene
from web.view.server import ViewServer

RATE = 20.0  # Hz
MOST_FRAMES = 12_000
"""Ten minutes at the full rate; a longer log has fewer frames a second. They are in memory."""
SHOWN = ("state", "reference", "truth", "actuators", "status", "bearings", "bearing_pose")
CHANGES = "parameter_changes"
LEAST_PROGRESS = 0.01


def record(log: Path, file: Path, progress: Callable[[float], None] = lambda share: None) -> None:
    """Write the recording of a closed log. Raises StorageError or LogFormatError."""
    summary = summarize(log)
    server = ViewServer()
    try:
        content = _Flight(log, server).play(summary.duration, progress)
    finally:
        server.stop()
    with os_errors(lambda why: f"cannot write {file}: {why}"), replacing(file) as new:
        new.write_bytes(content)


class _Flight:
    """Playback of one log through the scene of the page, on the log's clock."""

    def __init__(self, log: Path, server: ViewServer) -> None:
        self._log = log
        self._server = server
        self._now = 0.0  # s, log time
        self._types: dict[str, str] = {}  # present type name → type name in the log
        self._live = Live(self._decode, lambda: self._now)
        self._scene = Scene(server, self._live)
        view = self._scene.beacons.view  # rays and cones are most of the bytes
        self._scene.beacons.show(replace(view, rays=False, cones=False, estimate="none"))
        self._values = _station_values(log)
        self._scene_of_parameters()

    def play(self, duration: float, progress: Callable[[float], None]) -> bytes:
        """Play the flight into a recording; `duration` is that of the log, s."""
        recording = self._server.viser.get_scene_serializer()
        start = due = told = 0.0
        period, frames = max(1.0 / RATE, duration / MOST_FRAMES), 0
        for message in read_log(self._log):
            name = message.topic.rpartition("/")[2]
            if name not in SHOWN and name != CHANGES:
                continue
            now = message.log_ns * 1e-9
            start = start or now
            due = due or now
            # A clock that jumps must not produce hours of frames; a gap is shown as one long frame.
            if now >= due:
                if frames >= 2 * MOST_FRAMES:
                    break  # the log is longer than its index claims
                frames += 1
                recording.insert_sleep(min(now - due + period, max(1.0, period)))
                due = now + period
                self._scene.update(self._now)
                share = min(1.0, (now - start) / duration) if duration > 0.0 else 1.0
                if share - told >= LEAST_PROGRESS:
                    told = share
                    progress(share)
            self._now = now
            if name == CHANGES:
                self._change(cast("ParameterChange", decode(message.payload, message.type_name)))
            else:
                self._types[TOPICS[name].type_name] = message.type_name
                self._live.put(name, message.payload)
        self._scene.update(self._now)
        return recording.serialize()

    def _decode(self, payload: bytes, type_name: str) -> Any:
        return decode(payload, self._types.get(type_name, type_name))

    def _change(self, change: ParameterChange) -> None:
        """Apply a change of a parameter that the 3D view shows."""
        if change.name == f"{BEARINGS}layout":
            self._values[change.name] = str(logged_value(change.new_value))
            self._scene_of_parameters()

    def _scene_of_parameters(self) -> None:
        self._scene.show_parameters(self._values.get)
        show_bearings(self._scene.beacons, bearing_values(self._values.get))


def _station_values(log: Path) -> dict[str, Any]:
    """Return the parameters of vehicle and station by their full names, as at the start."""
    try:
        content = json_value(read_attachments(log).get("parameters.json", b"{}"))
    except ValueError:
        return {}
    if not isinstance(content, dict):
        return {}
    parts = (content.get(name) for name in ("vehicle", "station"))
    return {name: one for part in parts if isinstance(part, dict) for name, one in part.items()}
