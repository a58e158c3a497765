"""A log is as other MCAP tools expect, and survives its writer."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Attachment, Header, Metadata
from mcap.stream_reader import StreamReader

from flight_log import LogWriter, read_attachments, read_log, read_metadata, summarize
from flight_log.records import RawMessage, records
from flight_log.writer import Batch
from quadrotor.errors import StorageError
from vehicle_link import messages

STRING = "std_msgs/String"


def text_message(text: str) -> bytes:
    return messages.encode(messages.new(STRING, data=text))


def text_of(payload: bytes) -> str:
    message: Any = messages.decode(payload, STRING)
    return str(message.data)


def write_some(path: Path, count: int) -> None:
    with LogWriter(path, {"run_id": "r1", "operator": "me"}, {"parameters.json": b"{}"}) as log:
        for i in range(count):
            log.write("/quad1/events", STRING, text_message(f"m{i}"), 1000 + i, 500 + i)


def test_what_was_written_is_read_back(tmp_path: Path) -> None:
    write_some(tmp_path / "a.mcap", 10)
    read = list(read_log(tmp_path / "a.mcap"))
    assert [text_of(m.payload) for m in read] == [f"m{i}" for i in range(10)]
    assert [m.log_ns for m in read] == list(range(1000, 1010))
    assert [m.publish_ns for m in read] == list(range(500, 510))
    assert {(m.topic, m.type_name) for m in read} == {("/quad1/events", "std_msgs/msg/String")}


def test_only_the_wanted_topics_are_read(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "a.mcap", {}, {}) as log:
        for topic in ("/a", "/b", "/a"):
            log.write(topic, STRING, text_message(topic), 0, 0)
    assert [m.topic for m in read_log(tmp_path / "a.mcap", topics={"/a"})] == ["/a", "/a"]


def test_the_file_follows_the_ros2_profile(tmp_path: Path) -> None:
    write_some(tmp_path / "a.mcap", 3)
    with (tmp_path / "a.mcap").open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        index = reader.get_summary()
        assert index is not None
        [channel] = index.channels.values()
        [schema] = index.schemas.values()
    assert channel.message_encoding == "cdr"
    assert (schema.name, schema.encoding) == ("std_msgs/msg/String", "ros2msg")
    assert b"string data" in schema.data
    assert channel.metadata == {
        "offered_qos_profiles": "[]",
        "topic_type_hash": messages.type_hash(STRING),
    }
    assert channel.metadata["topic_type_hash"].startswith("RIHS01_df668c740482bbd4")


def test_a_schema_carries_the_definitions_it_needs(tmp_path: Path) -> None:
    state = messages.new("nav_msgs/Odometry", child_frame_id="quad1/body")
    with LogWriter(tmp_path / "a.mcap", {}, {}) as log:
        log.write("/quad1/state", "nav_msgs/Odometry", messages.encode(state), 0, 0)
    with (tmp_path / "a.mcap").open("rb") as stream:
        index = make_reader(stream).get_summary()
        assert index is not None
        [schema] = index.schemas.values()
    assert b"MSG: geometry_msgs/Quaternion" in schema.data


def test_run_and_attachments_stand_before_the_first_message(tmp_path: Path) -> None:
    write_some(tmp_path / "a.mcap", 3)
    kinds = [type(r) for r in records(tmp_path / "a.mcap")]
    assert kinds[:3] == [Header, Metadata, Attachment]
    assert kinds.index(RawMessage) > kinds.index(Attachment)
    assert read_attachments(tmp_path / "a.mcap") == {"parameters.json": b"{}"}
    assert read_metadata(tmp_path / "a.mcap")["quadlab.run"]["operator"] == "me"


def test_one_topic_with_two_types_gets_two_channels(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "a.mcap", {}, {}) as log:
        log.write("/a", STRING, text_message("x"), 0, 0)
        log.write("/a", "std_msgs/Bool", messages.encode(messages.new("std_msgs/Bool")), 1, 1)
    read = list(read_log(tmp_path / "a.mcap"))
    assert [m.type_name for m in read] == ["std_msgs/msg/String", "std_msgs/msg/Bool"]


def test_a_log_never_overwrites_another(tmp_path: Path) -> None:
    write_some(tmp_path / "a.mcap", 1)
    before = (tmp_path / "a.mcap").read_bytes()
    with pytest.raises(StorageError, match="exists already"):
        LogWriter(tmp_path / "a.mcap", {}, {})
    assert (tmp_path / "a.mcap").read_bytes() == before


def test_a_folder_that_cannot_be_made_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match=r"cannot make .*check the folder"):
        LogWriter(tmp_path / "file" / "a.mcap", {}, {})


def test_a_removed_file_is_noticed(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "a.mcap", {}, {}) as log:
        assert log.is_in_place()
        (tmp_path / "a.mcap").unlink()
        assert not log.is_in_place()


def test_writing_to_a_closed_log_is_refused(tmp_path: Path) -> None:
    log = LogWriter(tmp_path / "a.mcap", {}, {})
    log.close()
    log.close()
    with pytest.raises(StorageError, match="closed"):
        log.write("/a", STRING, text_message("x"), 0, 0)
    with pytest.raises(StorageError, match="closed"):
        log.write_batches([batch("/a", [1])])


def batch(topic: str, log_ns: list[int]) -> Batch:
    texts = [text_message(f"{topic}{k}") for k in range(len(log_ns))]
    payloads = np.frombuffer(b"".join(texts), f"V{len(texts[0])}")
    stamps = np.array(log_ns)
    return Batch(topic, STRING, payloads, stamps, stamps - 1)


def test_batches_are_written_in_the_order_of_their_time(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "a.mcap", {}, {}) as log:
        log.write("/a", STRING, text_message("first"), 5, 5)
        log.write_batches([batch("/b", [10, 20, 30]), batch("/a", [10, 15])])
        log.write_batches([batch("/c", [31])])
        assert log.message_count == 7
    read = list(read_log(tmp_path / "a.mcap"))
    assert [m.topic for m in read] == ["/a", "/b", "/a", "/a", "/b", "/b", "/c"]
    assert [m.log_ns for m in read] == [5, 10, 10, 15, 20, 30, 31]
    assert [m.publish_ns for m in read[1:]] == [9, 9, 14, 19, 29, 30]
    assert [m.sequence for m in read] == list(range(1, 8))
    text = [text_of(m.payload) for m in read[1:]]
    assert text == ["/b0", "/a0", "/a1", "/b1", "/b2", "/c0"]


def test_a_full_disk_is_said_at_once_and_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    log = LogWriter(tmp_path / "a.mcap", {}, {})
    full = os.open("/dev/full", os.O_WRONLY)
    monkeypatch.setattr(log._file, "_fd", full)
    with pytest.raises(StorageError, match="No space left"):
        log.write("/a", STRING, text_message("x"), 0, 0)
    with pytest.raises(StorageError, match="No space left"):
        log.write("/a", STRING, text_message("x"), 1, 0)
    log.close()
    with pytest.raises(StorageError):
        log.flush()


def test_the_summary_of_a_closed_file_counts_its_messages(tmp_path: Path) -> None:
    write_some(tmp_path / "a.mcap", 25)
    summary = summarize(tmp_path / "a.mcap")
    assert summary.closed
    assert not summary.recovered
    assert summary.message_count == 25
    assert summary.duration == pytest.approx(24e-9)
    assert summary.attachments == {"parameters.json": 2}
    assert summary.run["run_id"] == "r1"


WRITE_UNTIL_KILLED = """
import sys
from pathlib import Path
from vehicle_link import messages
from flight_log import LogWriter
log = LogWriter(Path(sys.argv[1]), {"run_id": "killed"}, {"parameters.json": b"{}"})
payload = bytes(200)
for i in range(5000):
    for topic in ("/a", "/b", "/c"):
        log.write(topic, "std_msgs/String", payload, i * 2_000_000, i)
print("ready", flush=True)
sys.stdin.read()
"""


def test_a_killed_writer_loses_no_more_than_fifty_milliseconds(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    child = subprocess.Popen(
        [sys.executable, "-c", WRITE_UNTIL_KILLED, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert child.stdout is not None
    assert child.stdout.readline() == b"ready\n"
    child.send_signal(signal.SIGKILL)
    child.communicate(timeout=10)
    last = max(m.log_ns for m in read_log(path))
    assert last >= 4999 * 2_000_000 - 50_000_000
    assert read_attachments(path) == {"parameters.json": b"{}"}
    with path.open("rb") as stream, pytest.raises(EndOfFile):
        list(StreamReader(stream).records)  # it really is an unfinished file
