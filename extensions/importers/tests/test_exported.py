"""Runs that quadlab exports come back through import as the same runs."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as some

from extensions.export.export import export
from extensions.importers.exported import is_exported, read_exported, write_exported
from flight_log import LogWriter
from flight_log.columns.log_columns import read_columns
from quadlab.__main__ import main
from quadrotor.errors import LogFormatError
from vehicle_link.messages import encode, header, new

START = 1_769_851_842_123_456_789
HOUR = 3_600_000_000_000
BOOT = 60_000_000_000
"""ns since 1970 on a computer whose clock has no battery."""
Message = tuple[str, str, int, int, dict[str, Any]]
"""Topic, type, stamp and time of reception in ns, and fields."""
NUMBERS = some.floats(-1e6, 1e6, width=32)
WORDS = some.text(some.characters(codec="utf-8", exclude_categories=("C", "Z")), max_size=6)
UNITS = some.tuples(NUMBERS, NUMBERS, NUMBERS)


@some.composite
def runs(draw: some.DrawFn) -> list[Message]:
    """Return messages of a random run, in which the clocks of both sides may be set."""
    found: list[Message] = []
    received, set_by = draw(some.sampled_from([START, BOOT])), 0
    for _ in range(draw(some.integers(1, 12))):
        received += draw(some.integers(1, 30_000_000_000))
        received += draw(some.sampled_from([0, START])) if received < START else 0
        set_by = draw(some.sampled_from([set_by, set_by, HOUR, 2 * HOUR]))
        times = received + set_by, received
        kind = draw(some.sampled_from(["state", "bearings", "status", "battery", "events"]))
        if kind == "state":
            pose = {"pose": {"position": draw(UNITS)}}
            fields: dict[str, Any] = {"pose": pose, "child_frame_id": draw(WORDS)}
            found.append((kind, "nav_msgs/Odometry", *times, fields))
        elif kind == "bearings":
            seen = draw(some.lists(UNITS, max_size=3))
            ids = [draw(some.integers(0, 255)) for _ in seen]
            fields = {"sigma": draw(NUMBERS), "beacon_ids": ids, "bearings": seen}
            found.append((kind, "quadlab_msgs/BearingArray", *times, fields))
        elif kind == "status":
            fields = {"mode": draw(WORDS)}
            found.append((kind, "quadlab_msgs/VehicleStatus", *times, fields))
        elif kind == "events":
            level = draw(some.sampled_from([10, 20, 30, 40, 50]))
            fields = {"level": level, "name": "q.vehicle", "msg": draw(WORDS)}
            found.append((kind, "rcl_interfaces/Log", *times, fields))
        else:
            fields = {"voltage": draw(NUMBERS), "present": draw(some.booleans())}
            found.append((kind, "sensor_msgs/BatteryState", *times, fields))
    return found


def write_log(path: Path, messages: list[Message]) -> Path:
    with LogWriter(path, {"vehicle": "q", "experiment": "hover"}, {}) as writer:
        for topic, kind, stamp, received, fields in messages:
            at = header(stamp)
            head = {"stamp": at.stamp} if kind == "rcl_interfaces/Log" else {"header": at}
            payload = encode(new(kind, **head, **fields))
            writer.write(f"/q/{topic}", kind, payload, received, stamp)
    return path


def content(log: Path) -> dict[str, dict[str, list[Any]]]:
    """Return all columns of a log by topic; NaN as a word, so that it equals itself."""
    found = {}
    for name, topic in read_columns(log, lambda share: None, np.float64).topics.items():
        columns: dict[str, list[Any]] = {"log": topic.log_ns.tolist()}
        for one in topic.names:
            columns[one] = [repr(value) for value in topic.values(one).tolist()]
        columns |= {one: list(changes) for one, changes in topic.texts.items()}
        found[name] = {"type": [topic.type_name], **columns}
    return found


def there_and_back(folder: Path, log: Path, kind: str) -> Path:
    out = folder / kind
    done = export(log, out, kind)
    written = done.files[0] if kind == "mat" else out
    assert is_exported(written)
    tables, notes = read_exported(written)
    assert not notes
    back = folder / f"{kind}.mcap"
    write_exported(back, tables, "q", tables[0].run)
    return back


@settings(max_examples=12, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(runs())
def test_an_exported_run_comes_back_as_the_same_run(messages: list[Message]) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = write_log(folder / "run.mcap", messages)
        expected = content(log)
        for kind in ("csv", "parquet", "mat"):
            assert content(there_and_back(folder, log, kind)) == expected, kind


def test_messages_come_back_byte_by_byte(tmp_path: Path) -> None:
    messages = [
        (
            "bearings",
            "quadlab_msgs/BearingArray",
            START + k,
            START + k,
            {"bearings": [(k, 0.0, 1.0)] * (k % 3)},
        )
        for k in range(9)
    ]
    log = write_log(tmp_path / "run.mcap", messages)
    back = there_and_back(tmp_path, log, "parquet")
    assert payloads(back) == payloads(log)


def payloads(log: Path) -> list[bytes]:
    from mcap.reader import make_reader

    with log.open("rb") as file:
        return [message.data for *_, message in make_reader(file).iter_messages()]


def test_a_folder_of_an_export_is_imported_by_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fields = {"voltage": 14.8, "present": True}
    log = write_log(
        tmp_path / "run.mcap",
        [("battery", "sensor_msgs/BatteryState", START + k, START + k, fields) for k in range(5)],
    )
    export(log, tmp_path / "out", "parquet")
    (tmp_path / "out/strange.csv").write_text("a,b\n1,2\n")
    data = tmp_path / "data"
    assert main(["log", "import", str(tmp_path / "out"), "--data", str(data)]) == 0
    assert "5 messages of 1 topics" in capsys.readouterr().out
    [run] = (data / "runs").glob("2*")
    assert content(run / "station.mcap") == content(log)


def test_a_topic_of_an_unknown_type_is_named(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "thing.csv").write_text(
        '"time [s]","stamp_ns [ns]","received_ns [ns]","x"\n0,1,2,3\n'
    )
    with pytest.raises(LogFormatError, match="thing is left out: the type"):
        read_exported(folder)
