"""Foxglove's own readers, run by node, read the same from logs as this project's reader."""

from __future__ import annotations

import hashlib
import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from flight_log import LogWriter, read_log, recover
from flight_log.merge import merge
from flight_log.run_folder import MERGED, STATION, VEHICLE
from tests.flight_log.drop_outs import Flight, flown, with_holes
from vehicle_link.messages import decode, encode, new, stored_name, typestore
from vehicle_link.topics.table import TOPICS

ROOT = Path(__file__).parents[2]
READER = Path(__file__).with_name("foxglove_reader.js")


def by_foxglove(node_path: str, path: Path) -> dict[str, Any]:
    done = subprocess.run(
        [node_path, READER, path], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    assert found["whole"]
    assert found["streamed"] == found["counted"] == len(found["messages"])
    return found


def filled(type_name: str, random: np.random.Generator) -> Any:
    """Return a message of this type with random values in every field."""
    fields = typestore().fielddefs[stored_name(type_name)][1]
    return new(type_name, **{name: _value(what[0], what[1], random) for name, what in fields})


def _value(kind: Any, details: Any, random: np.random.Generator) -> Any:
    if kind.name == "NAME":
        return filled(details, random)
    if kind.name == "BASE":
        return _scalar(details[0], random)
    inner, count = details
    count = count if kind.name == "ARRAY" else int(random.integers(1, 4))
    values = [_value(inner[0], inner[1], random) for _ in range(count)]
    if inner[0].name == "BASE" and inner[1][0] not in ("string", "bool"):
        return np.array(values, dtype=_dtype(inner[1][0]))
    return values


def _scalar(kind: str, random: np.random.Generator) -> Any:
    if kind == "string":
        return f"é {random.integers(1000)}"
    if kind == "bool":
        return bool(random.integers(2))
    if kind.startswith("float"):
        return np.dtype(kind).type(random.normal()).item()
    if kind in ("octet", "byte"):
        return int(random.integers(128))  # above it, ROS 1 and ROS 2 differ in its sign
    limits = np.iinfo(kind)
    return int(random.integers(limits.min, limits.max, dtype=limits.dtype, endpoint=True))


def _dtype(kind: str) -> np.dtype[Any]:
    return np.dtype("uint8" if kind in ("octet", "byte") else kind)


def plain(value: Any) -> Any:
    """Return a message, or its JSON, as dictionaries and lists, with every integer as text.

    Integers of 64 bits have no other form in JSON.
    """
    if hasattr(value, "__dataclass_fields__"):
        names = [name for name in value.__dataclass_fields__ if name != "__msgtype__"]
        return {name: plain(getattr(value, name)) for name in names if not name.isupper()}
    if isinstance(value, dict):
        return {name: plain(one) for name, one in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list):
        return [plain(one) for one in value]
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


def test_every_topic_is_decoded_to_the_values_that_were_written(
    tmp_path: Path, node_path: str
) -> None:
    random = np.random.default_rng(11)
    path, written = tmp_path / "run.mcap", []
    with LogWriter(path, {"run_id": "r"}, {"parameters.json": b"{}"}) as log:
        for number, row in enumerate(TOPICS.values()):
            message = filled(row.type_name, random)
            written.append((f"/quad1/{row.name}", plain(message)))
            payload = encode(message)
            assert plain(decode(payload, row.type_name)) == written[-1][1]
            log.write(f"/quad1/{row.name}", row.type_name, payload, 1000 + number, 900)
    found = by_foxglove(node_path, path)
    assert [(one["topic"], plain(one["content"])) for one in found["messages"]] == written
    assert found["attachments"] == ["parameters.json"]
    assert found["metadata"]["quadlab.run"]["run_id"] == "r"


def test_a_run_s_logs_and_a_mended_one_have_the_same_messages(
    tmp_path: Path, node_path: str
) -> None:
    run = tmp_path / "run"
    flight = Flight(flown(400), with_holes(400, 2))
    flight.record(run / STATION)
    flight.log_onboard(run / VEHICLE)
    merge(run)
    torn = tmp_path / "torn.mcap"
    data = (run / MERGED).read_bytes()
    torn.write_bytes(data[: len(data) * 2 // 3])
    recover(torn)
    for path in (run / STATION, run / VEHICLE, run / MERGED, torn):
        found = [
            (one["topic"], int(one["log_ns"]), int(one["publish_ns"]), one["sha1"])
            for one in by_foxglove(node_path, path)["messages"]
        ]
        own = [
            (m.topic, m.log_ns, m.publish_ns, hashlib.sha1(m.payload).hexdigest())
            for m in read_log(path)
        ]
        assert len(own) > 400
        assert sorted(found) == sorted(own)
