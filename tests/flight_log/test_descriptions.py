"""No message of a channel is skipped, wherever its description is in the log."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

from flight_log.blocks import BlockReader
from flight_log.check import check_log
from flight_log.reader import read_log
from flight_log.recovery import recover
from tests.crafted_logs import TINY, chunk, message, packed, record, write

START = 1_769_851_842_000_000_000
PAYLOAD = b"\0\1\0\0" + bytes(8)
COUNT = 20


def write_log(path: Path, *, ends: bool = True) -> Path:
    """Write a log whose second topic is described in a chunk with messages of only the first."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=1, compression=CompressionType.LZ4)
        writer.start("ros2", "other")
        channels = []
        for name in ("a", "b"):
            writer.flush()
            schema = writer.register_schema(f"x/msg/{name}", "ros2msg", b"float64 v\n")
            channels.append(writer.register_channel(f"/{name}", "cdr", schema))
            writer.add_message(channels[0], START, PAYLOAD, START)
        for k in range(1, COUNT):
            for channel in channels:
                writer.add_message(channel, START + k, PAYLOAD, START + k)
        writer.flush()
        if ends:
            writer.finish()
    return path


@pytest.mark.parametrize("ends", [True, False])
def test_a_description_in_a_chunk_of_other_messages_is_found(tmp_path: Path, ends: bool) -> None:
    found = check_log(write_log(tmp_path / "a.mcap", ends=ends))
    assert {name: topic.count for name, topic in found.topics.items()} == {
        "/a": COUNT + 1,
        "/b": COUNT - 1,
    }
    assert len(found.problems) == (not ends)


def test_a_description_in_a_damaged_chunk_is_taken_from_the_index(tmp_path: Path) -> None:
    path = write_log(tmp_path / "a.mcap")
    data = bytearray(path.read_bytes())
    at = data.index(b"x/msg/b")  # short texts are stored as they are
    data[at] ^= 0xFF
    path.write_bytes(data)
    found = check_log(path)
    assert found.problems == ["1 damaged chunks, whose messages are lost"]
    assert found.topics["/b"].count == COUNT - 1
    assert sum(m.topic == "/b" for m in read_log(path)) == COUNT - 1


def test_messages_whose_description_is_lost_are_a_problem_and_not_silence(tmp_path: Path) -> None:
    path = write_log(tmp_path / "a.mcap", ends=False)
    data = bytearray(path.read_bytes())
    data[data.index(b"x/msg/b")] ^= 0xFF
    path.write_bytes(data)
    problems = check_log(path).problems
    assert any("its description was in a damaged chunk" in line for line in problems)


def test_a_damaged_index_is_made_anew_and_nothing_else_changes(tmp_path: Path) -> None:
    path = write_log(tmp_path / "a.mcap")
    before = [tuple(message) for message in read_log(path)]
    data = bytearray(path.read_bytes())
    data[-60] ^= 0xFF
    path.write_bytes(data)
    [problem] = check_log(path).problems
    assert "has a damaged index" in problem
    assert recover(path).messages == len(before)
    assert check_log(path).problems == []
    assert [tuple(message) for message in read_log(path)] == before
    assert not recover(path).torn


def test_what_is_whole_behind_a_damaged_middle_is_kept_beside(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    torn = write_log(path, ends=False).read_bytes() + b"\0" * 100 + b"\7" * 3_000_000
    path.write_bytes(torn)
    found = recover(path)
    assert found.messages == 2 * COUNT
    assert found.kept == tmp_path / "a.torn"
    assert found.kept.read_bytes() == torn
    path.write_bytes(torn[:-3_000_000] + bytes(3_000_000))  # what some file systems leave
    assert recover(path).kept is None


@pytest.mark.parametrize("opcode", [Opcode.SCHEMA, Opcode.CHANNEL])
def test_a_description_of_one_byte_in_a_chunk_is_counted_as_damaged(
    tmp_path: Path, opcode: int
) -> None:
    short = record(opcode, b"\2")
    inside = short + message(1, TINY)
    path = write(tmp_path / "a.mcap", chunk(packed([inside]), len(inside)))
    log = BlockReader(path)
    assert sum(len(places) for block in log for places in block.places.values()) == 1
    assert log.damaged_records == 1
