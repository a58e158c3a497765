"""Recording for viser: made from a log in a separate process, stored, made again when old."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import zstandard

from flight_log import LogWriter
from quadrotor.errors import RefusedError
from vehicle_link.messages import encode, header, new
from web.runs.exports import ViserExports
from web.runs.viser_recording import RATE, record

SECONDS = 3.0
LAYOUT = "1 1.5 1 0.1; 2 -1.5 1 0.1; 3 -1.5 -1 0.1; 4 1.5 -1 0.1"
PARAMETERS = {
    "vehicle": {
        f"behavior.volume_{a}_{e}": v for a in "xyz" for e, v in (("min", 0.0), ("max", 3.0))
    }
    | {"behavior.keep_out": "pillar 1 2 1 2 0 3"},
    "station": {"station.bearings.layout": LAYOUT},
}


def write_flight(path: Path, seconds: float = SECONDS) -> None:
    """Write a straight line along x at 1 m/s, 100 Hz."""
    attachments = {"parameters.json": msgspec.json.encode(PARAMETERS)}
    with LogWriter(path, {"vehicle": "quad1"}, attachments) as log:
        for i in range(round(seconds * 100)):
            ns = 1_000_000_000 + i * 10_000_000
            pose = {"pose": {"position": (i * 0.01, 0.0, 1.0), "orientation": (0.0, 0.0, 0.0, 1.0)}}
            state = new("nav_msgs/Odometry", header=header(ns), pose=pose)
            log.write("/quad1/state", "nav_msgs/Odometry", encode(state), ns, ns)


def play(file: Path) -> dict[str, Any]:
    """Return what viser's client reads from a recording."""
    content = file.read_bytes()
    size = int.from_bytes(content[:8], "little")
    inner = zstandard.ZstdDecompressor().decompress(content[8:], max_output_size=size)
    length = int.from_bytes(inner[:8], "little")
    found: dict[str, Any] = msgspec.msgpack.decode(inner[8 : 8 + length])
    return found


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    log = tmp_path / "r1.mcap"
    write_flight(log)
    return log


def test_a_recording_moves_the_vehicle_as_it_flew_and_shows_the_beacons(flight: Path) -> None:
    told: list[float] = []
    file = flight.with_name("r1.viser")
    record(flight, file, told.append)
    recording = play(file)
    assert recording["durationSeconds"] == pytest.approx(SECONDS, abs=2.5 / RATE)
    moves = [
        (at, message["position"][0])
        for at, message in recording["messages"]
        if message["type"] == "SetPositionMessage" and message["name"] == "/vehicle"
    ]
    at, x = np.array(moves).T
    assert len(at) > 0.9 * SECONDS * RATE
    assert np.abs(x - at).max() < 2.5 / RATE, "1 m/s"
    names = {message.get("name", "") for _, message in recording["messages"]}
    assert any(name.startswith("/flown") for name in names)
    assert {"/volume", "/keep_out/0"} <= names
    beacons = [
        message["position"]
        for _, message in recording["messages"]
        if message["type"] == "SetPositionMessage" and message["name"] == "/beacons/0"
    ]
    assert list(beacons[-1][:2]) == [1.5, 1.0]
    assert told == sorted(told)
    assert told[-1] > 0.9
    assert not list(flight.parent.glob("*.new"))


@pytest.fixture
def exports() -> Iterator[ViserExports]:
    made = ViserExports()
    yield made
    made.stop()


def finished(exports: ViserExports, log: Path) -> Any:
    waiting = threading.Event()
    for _ in range(6000):
        export = exports.ask("r1", log)
        if export.name in ("ready", "failed"):
            return export
        waiting.wait(0.01)
    raise AssertionError(f"waited in vain: {export}")


def test_it_is_made_once_and_again_when_the_log_is_a_newer_one(
    exports: ViserExports, flight: Path
) -> None:
    assert exports.ask("r1", flight).name in ("waiting", "working")
    export = finished(exports, flight)
    assert export.name == "ready", export.reason
    assert export.path is not None
    assert play(export.path)["durationSeconds"] > 0
    made = export.path.stat().st_mtime_ns
    assert exports.ask("r1", flight).path == export.path
    later = made + 1_000_000_000
    os.utime(flight, ns=(later, later))
    assert exports.ask("r1", flight).name in ("waiting", "working")


def test_a_log_that_is_none_fails_with_the_reason_and_is_not_tried_again(
    exports: ViserExports, tmp_path: Path
) -> None:
    log = tmp_path / "r1.mcap"
    log.write_bytes(bytes(range(256)) * 40)
    export = finished(exports, log)
    assert export.name == "failed"
    assert "r1.mcap" in export.reason
    assert exports.ask("r1", log) is export


def test_a_run_being_recorded_has_no_recording_yet(exports: ViserExports, tmp_path: Path) -> None:
    log = tmp_path / "r1.mcap"
    with LogWriter(log, {}, {}), pytest.raises(RefusedError, match="is being recorded"):
        exports.ask("r1", log)


def test_a_run_deleted_meanwhile_leaves_no_recording_behind(
    exports: ViserExports, flight: Path, until: Callable[..., None]
) -> None:
    export = exports.ask("r1", flight)
    until(lambda: export.name == "working")
    flight.rename(flight.with_name("elsewhere"))
    until(lambda: export.name == "failed", 60.0)
    assert [path.name for path in flight.parent.iterdir()] == ["elsewhere"]


def test_stopping_ends_the_process_and_leaves_nothing_half(
    exports: ViserExports, tmp_path: Path, until: Callable[..., None]
) -> None:
    log = tmp_path / "r1.mcap"
    write_flight(log, 30.0)
    export = exports.ask("r1", log)
    until(lambda: export.name == "working")
    exports.stop()
    until(lambda: export.name == "failed")
    assert export.reason == "stopped"
    assert [path.name for path in tmp_path.iterdir()] == ["r1.mcap"]
