"""A log as columns has the content of its messages, complete or torn, of any types."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType, Writer

from flight_log import LogWriter, read_log
from flight_log.check import check_log
from flight_log.topic_columns import ColumnReader
from quadrotor.errors import LogFormatError, StorageError
from vehicle_link.messages import decode, encode, header, new

STAMP = 1_769_851_842_000_000_000


def messages(count: int) -> list[tuple[str, Any]]:
    """Return messages of fixed and of variable size: arrays, texts, nested sequences."""
    random = np.random.default_rng(7)
    found: list[tuple[str, Any]] = []
    for k in range(count):
        head = header(STAMP + k * 2_000_000)
        pose = {"pose": {"position": random.standard_normal(3)}}
        found.append(("/q/state", new("nav_msgs/Odometry", header=head, pose=pose)))
        seen = int(random.integers(0, 5))
        found.append(
            (
                "/q/bearings",
                new(
                    "quadlab_msgs/BearingArray",
                    header=head,
                    sigma=0.1 * k,
                    beacon_ids=list(range(seen)),
                    bearings=[tuple(random.standard_normal(3)) for _ in range(seen)],
                ),
            )
        )
        found.append(
            (
                "/q/status",
                new(
                    "quadlab_msgs/VehicleStatus",
                    header=head,
                    armed=k % 2 == 0,
                    mode="armed" if k % 7 else "ready",
                    flags=["a", "bc"][: k % 3],
                ),
            )
        )
    return found


def write(path: Path, count: int = 200) -> Path:
    with LogWriter(path, {"vehicle": "q"}, {"parameters.json": b"{}"}) as log:
        for k, (topic, message) in enumerate(messages(count)):
            name = message.__msgtype__.replace("/msg/", "/")
            log.write(topic, name, encode(message), STAMP + k * 1_000_000, STAMP + k * 1_000_000)
    return path


def read(path: Path) -> tuple[ColumnReader, dict[str, dict[str, Any]]]:
    """Return all blocks in one: topic → path → values; `@log` the times, `#path` the texts."""
    reader = ColumnReader(path, whole=("/status",))
    found: dict[str, dict[str, Any]] = {}
    for batch in reader:
        for columns in batch.columns:
            topic = found.setdefault(columns.topic, {"@log": np.zeros(0, np.int64)})
            before = len(topic["@log"])
            topic["@log"] = np.concatenate([topic["@log"], columns.log_ns])
            for name, values in columns.numbers.items():
                kept = topic.get(name, np.zeros(0))
                gap = np.full(before - len(kept), np.nan)
                topic[name] = np.concatenate([kept, gap, values])
            for name, changes in columns.texts.items():
                topic.setdefault(f"#{name}", []).extend((before + k, text) for k, text in changes)
    return reader, found


def value(message: Any, path: str) -> float:
    for step in path.replace("[", ".[").split("."):
        message = message[int(step[1:-1])] if step.startswith("[") else getattr(message, step)
    return float(message)


@pytest.mark.parametrize("block", [3000, 4_000_000])
def test_columns_hold_what_the_messages_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int
) -> None:
    monkeypatch.setattr("flight_log.blocks.BLOCK_BYTES", block)
    log = write(tmp_path / "a.mcap")
    reader, found = read(log)
    assert reader.problems == {}
    assert reader.log.tear == ""
    assert reader.log.attachments == {"parameters.json": b"{}"}
    rows = dict.fromkeys(found, 0)
    for message in read_log(log):
        k, topic = rows[message.topic], found[message.topic]
        rows[message.topic] += 1
        decoded = decode(message.payload, message.type_name)
        assert topic["@log"][k] == message.log_ns
        for path, values in topic.items():
            if path[0] in "@#" or k >= len(values):
                continue
            try:
                expected = value(decoded, path)
            except IndexError:
                assert np.isnan(values[k])
                continue
            assert values[k] == expected
    assert rows == {"/q/state": 200, "/q/bearings": 200, "/q/status": 200}
    assert "bearings[3].z" in found["/q/bearings"]
    assert "header.stamp.sec" not in found["/q/state"]


def test_texts_tell_where_they_change(tmp_path: Path) -> None:
    _, found = read(write(tmp_path / "a.mcap", 30))
    modes = ["armed" if k % 7 else "ready" for k in range(30)]
    expected = [(k, m) for k, m in enumerate(modes) if k == 0 or m != modes[k - 1]]
    assert found["/q/status"]["#mode"] == expected
    assert found["/q/status"]["#flags"][:3] == [(0, ""), (1, "a"), (2, "a, bc")]


@pytest.mark.parametrize("share", [0.3, 0.77, 0.95])
def test_a_torn_log_is_read_up_to_its_tear(tmp_path: Path, share: float) -> None:
    whole = write(tmp_path / "a.mcap").read_bytes()
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(whole[: int(share * len(whole))])
    _, found = read(torn)
    expected = [message.log_ns for message in read_log(torn) if message.topic == "/q/state"]
    assert len(expected) > 0
    assert found["/q/state"]["@log"].tolist() == expected


def test_a_damaged_chunk_is_passed_over(tmp_path: Path) -> None:
    log = write(tmp_path / "a.mcap", 400)
    data = bytearray(log.read_bytes())
    data[len(data) // 3] ^= 0xFF
    log.write_bytes(data)
    reader, found = read(log)
    expected = [message.log_ns for message in read_log(log) if message.topic == "/q/state"]
    assert 0 < len(expected) < 400
    assert found["/q/state"]["@log"].tolist() == expected
    assert reader.log.damaged_chunks == 1


def test_messages_that_are_none_cost_only_themselves(tmp_path: Path) -> None:
    log, good = tmp_path / "a.mcap", encode(new("quadlab_msgs/VehicleStatus", mode="ready"))
    big_endian = bytes([good[0], 0]) + good[2:]
    with LogWriter(log, {"vehicle": "q"}, {}) as writer:
        for k, payload in enumerate((big_endian, good, big_endian, good, good)):
            writer.write("/q/status", "quadlab_msgs/VehicleStatus", payload, STAMP + k, STAMP + k)
    reader, found = read(log)
    known = np.isfinite(found["/q/status"]["parameter_revision"])
    assert known[[1, 3, 4]].all()
    assert "little-endian" in reader.problems["/q/status"]


@pytest.mark.parametrize("chunked", [True, False])
def test_another_writers_log_of_another_type_is_read_by_its_own_description(
    tmp_path: Path, chunked: bool
) -> None:
    log = tmp_path / "foreign.mcap"
    text = b"float32 left\nint16[2] counts\nother_msgs/Inner inner\n" + b"=" * 80
    text += b"\nMSG: other_msgs/Inner\nuint8 flag\nfloat64 right\n"
    with log.open("wb") as file:
        writer = Writer(
            file, use_chunking=chunked, index_types=IndexType.NONE, compression=CompressionType.NONE
        )
        writer.start("ros2", "other")
        schema = writer.register_schema("other_msgs/msg/Outer", "ros2msg", text)
        channel = writer.register_channel("/other", "cdr", schema)
        other = writer.register_schema("x", "jsonschema", b"{}")
        told = writer.register_channel("/json", "json", other)
        for k in range(10):
            # float32, 2 int16, uint8, 7 B to the next multiple of 8 after the header, float64
            body = np.float32(k).tobytes() + np.array([k, -k], "<i2").tobytes()
            body += bytes([k]) + bytes(7) + np.float64(0.5 * k).tobytes()
            writer.add_message(channel, k, b"\x00\x01\x00\x00" + body, k)
            writer.add_message(told, k, b"{}", k)
        writer.finish()
    reader, found = read(log)
    steps = np.arange(10.0)
    assert list(found) == ["/other"]
    assert found["/other"]["left"].tolist() == steps.tolist()
    assert found["/other"]["counts[1]"].tolist() == (-steps).tolist()
    assert found["/other"]["inner.right"].tolist() == (0.5 * steps).tolist()
    assert "json" in reader.problems["/json"]


def test_events_of_a_service_are_read_by_the_description_of_the_service(tmp_path: Path) -> None:
    log = tmp_path / "service.mcap"
    with log.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start("ros2", "other")
        schema = writer.register_schema(
            "demo/srv/Add_Event", "ros2msg", b"int64 a\nint64 b\n---\nint64 sum\n"
        )
        channel = writer.register_channel("/add/_service_event", "cdr", schema)
        # type, 3 B, stamp, 16 B of an identity, 4 B, sequence, number of requests, 4 B, …
        head = struct.pack("<B3xiI16B4xq", 1, 7, 8, *range(16), 9)
        asked = head + struct.pack("<I4xqqI", 1, 3, 4, 0)
        answered = head + struct.pack("<IIq", 0, 1, 7)
        for k, body in enumerate((asked, answered)):
            writer.add_message(channel, k, b"\x00\x01\x00\x00" + body, k)
        writer.finish()
    reader, found = read(log)
    assert not reader.problems
    events = found["/add/_service_event"]
    assert events["info.sequence_number"].tolist() == [9, 9]
    assert (events["request[0].a"][0], events["request[0].b"][0]) == (3, 4)
    assert events["response[0].sum"][1] == 7
    assert check_log(log).problems == []


def test_what_is_no_log_is_refused_in_one_line(tmp_path: Path) -> None:
    empty, foreign = tmp_path / "empty.mcap", tmp_path / "foreign.mcap"
    empty.write_bytes(b"")
    foreign.write_bytes(bytes(range(256)))
    for path, why in ((empty, "is empty"), (foreign, "not an MCAP log")):
        with pytest.raises(LogFormatError, match=why) as caught:
            read(path)
        assert "\n" not in str(caught.value)
    with pytest.raises(StorageError, match="cannot read"):
        read(tmp_path / "nowhere.mcap")
