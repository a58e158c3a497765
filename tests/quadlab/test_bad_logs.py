"""A file that is not a sound log gets one clear line from every command, and is not changed."""

from __future__ import annotations

import io
import json
import os
import shutil
import struct
import threading
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from flight_log import LogWriter, read_log
from flight_log.attached import literal_value
from quadlab.__main__ import main
from vehicle_link.messages import encode, header, new

START = 1_769_851_842_000_000_000
HUGE = 10 * 2**30
COMMANDS = ("info", "check", "export", "report", "recover", "replay")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("log") / "whole.mcap"
    with LogWriter(path, {"vehicle": "q"}, {"parameters.json": b"{}"}) as log:
        for k in range(200):
            stamp = START + k * 2_000_000
            message = encode(new("sensor_msgs/Imu", header=header(stamp)))
            log.write("/q/imu", "sensor_msgs/Imu", message, stamp, stamp)
    return path.read_bytes()


def foreign(
    path: Path,
    encoding: str,
    schema: str,
    text: bytes,
    compression: CompressionType,
    name: str = "x/msg/Y",
    *,
    beside: str = "",
) -> None:
    """Write a log as another program would; `beside` adds a sound topic."""
    with path.open("wb") as stream:
        writer = Writer(stream, compression=compression)
        writer.start("", "other")
        if beside:
            sound = writer.register_schema("x/msg/Sound", "ros2msg", b"float64 x\n")
            good = writer.register_channel(beside, "cdr", sound)
            for k in range(10):
                writer.add_message(good, START + k, b"\0\1\0\0" + bytes(8), START + k)
        number = writer.register_schema(name, schema, text) if schema else 0
        channel = writer.register_channel("/thing", encoding, number)
        for k in range(10):
            writer.add_message(channel, START + k, b"\0\1\0\0" + bytes(8), START + k)
        writer.finish()


LZ4, ZSTD = CompressionType.LZ4, CompressionType.ZSTD
FOREIGN: dict[str, tuple[Sequence[Any], str]] = {
    "json": (("json", "jsonschema", b"{}", LZ4), "in 'json'; only 'cdr'"),
    "protobuf": (("protobuf", "protobuf", b"\x08\x01", LZ4), "in 'protobuf'; only 'cdr'"),
    "ros1": (("ros1", "ros1msg", b"float64 x\n", LZ4), "in 'ros1'; only 'cdr'"),
    "without schema": (("cdr", "", b"", LZ4), "does not describe its messages"),
    "idl": (("cdr", "ros2idl", b"module x {};", LZ4), "described in 'ros2idl'"),
    "nonsense": (("cdr", "ros2msg", b"\xff\xfe", LZ4), "description of x/msg/Y cannot be read"),
    "undescribed": (("cdr", "ros2msg", b"no/Such a\n", LZ4), "made of 'no/msg/Such'"),
    "named": (("cdr", "ros2msg", b"float64 x\n", LZ4, "foxglove.Thing"), "not the name of a ROS 2"),
    "of itself": (("cdr", "ros2msg", b"x/msg/Y a\n", LZ4), "made of itself"),
}


def broken(path: Path, kind: str, whole: bytes) -> None:
    """Damage a log so that no command can read it."""
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "loop":
        path.symlink_to(path.name)
    elif kind == "zeros":
        with path.open("wb") as file:
            file.truncate(HUGE)
    elif kind == "record":
        path.write_bytes(whole[:36] + struct.pack("<BQ", 9, HUGE // 2))
        with path.open("r+b") as file:
            file.truncate(HUGE)
    else:
        path.write_bytes({"empty": b"", "text": b"hello\n" * 99, "magic": whole[:8]}[kind])


BROKEN = {
    "folder": "is a folder",
    "pipe": "a pipe or a device",
    "loop": "is not a file",
    "empty": "is empty: nothing was recorded",
    "text": "is not an MCAP log",
    "zeros": "is not an MCAP log",
    "magic": "ends before its first record",
    "record": "a record of 5369 MB",
}


class OwnLines(io.StringIO):
    """Output of this thread alone: threads that other tests have left may complain meanwhile."""

    def __init__(self) -> None:
        super().__init__()
        self._thread = threading.get_ident()

    def write(self, text: str) -> int:
        return super().write(text) if threading.get_ident() == self._thread else len(text)


@pytest.fixture
def run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Return a function that runs a command on a log: its status, output and error."""

    def run(command: str, log: Path) -> tuple[int, str, str]:
        words = [command, str(log)] if command == "replay" else ["log", command, str(log)]
        if command in ("export", "report"):
            words += ["--out", str(tmp_path / "out")]
        if command == "report":
            words.append("--no-pdf")
        with redirect_stderr(OwnLines()) as complaint:
            status = main(words)
        return status, capsys.readouterr().out, complaint.getvalue()

    return run


@pytest.mark.parametrize("kind", BROKEN)
def test_what_cannot_be_read_is_one_line_of_every_command_and_stays(
    run: Callable[..., tuple[int, str, str]], tmp_path: Path, whole: bytes, kind: str
) -> None:
    log = tmp_path / "a.mcap"
    broken(log, kind, whole)
    before = log.lstat()
    for command in COMMANDS:
        status, out, complaint = run(command, log)
        assert (status, out, complaint.count("\n")) == (1, "", 1), (command, complaint)
        assert complaint.startswith("quadlab: ")
        assert BROKEN[kind] in complaint, command
    assert [p.name for p in tmp_path.iterdir()] == ["a.mcap"]
    after = log.lstat()
    assert (after.st_size, after.st_mtime_ns) == (before.st_size, before.st_mtime_ns)


@pytest.mark.parametrize("kind", FOREIGN)
def test_another_programs_log_is_named_for_what_it_is(
    run: Callable[..., tuple[int, str, str]], tmp_path: Path, kind: str
) -> None:
    log = tmp_path / "a.mcap"
    words, expected = FOREIGN[kind]
    foreign(log, *words)
    before = log.read_bytes()
    for command in ("check", "export", "report"):
        status, out, complaint = run(command, log)
        assert (status, (out + complaint).count("\n")) == (1, 1), command
        assert expected in out + complaint
    status, out, complaint = run("replay", log)
    assert (status, complaint.count("\n")) == (1, 1)
    assert run("recover", log)[0] == 0
    assert log.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.mcap"]


def test_a_log_in_zstd_is_read_as_one_in_lz4_and_another_compression_is_named(
    run: Callable[..., tuple[int, str, str]], tmp_path: Path
) -> None:
    log, other, third = (tmp_path / f"{name}.mcap" for name in ("zstd", "lz4", "brotli"))
    for path, compression in ((log, ZSTD), (other, LZ4)):
        foreign(path, "cdr", "ros2msg", b"float64 x\n", compression)
    assert list(read_log(log)) == list(read_log(other))
    assert len(list(read_log(log))) == 10
    assert run("check", log)[0] == 0
    content = log.read_bytes()
    assert content.count(b"zstd") == 2  # the chunk and its index
    unchecked = content[:-12] + bytes(4) + content[-8:]  # the index without its checksum
    third.write_bytes(unchecked.replace(b"zstd", b"brot"))
    status, out, complaint = run("export", third)
    assert (status, (out + complaint).count("\n")) == (1, 1)
    assert "compressed with 'brot'; allowed are lz4, zstd and none" in out + complaint
    log.write_bytes(content.replace(b"\x28\xb5\x2f\xfd", b"\x28\xb5\x2f\xfe"))  # its magic
    status, out, _ = run("check", log)
    assert (status, "damaged" in out) == (1, True)


@pytest.mark.parametrize("kind", sorted(FOREIGN))
def test_a_topic_that_cannot_be_read_costs_the_others_nothing(
    run: Callable[..., tuple[int, str, str]], tmp_path: Path, kind: str
) -> None:
    log = tmp_path / "a.mcap"
    words, expected = FOREIGN[kind]
    foreign(log, *words, beside="/ok")
    status, out, complaint = run("check", log)
    assert (status, out.count("\n"), complaint) == (1, 1, "")
    assert out.startswith("not sound: /thing: ")
    assert expected in out
    status, out, complaint = run("export", log)
    [told, _, rows] = out.splitlines()
    assert (status, rows, complaint) == (1, "10 rows in 1 files", "")
    assert told.startswith("not exported: /thing: ")
    table = (tmp_path / "out" / "ok.csv").read_text().splitlines()
    assert (len(table), table[0].split(",")[-1]) == (11, '"x"')
    shutil.rmtree(tmp_path / "out")
    assert run("report", log)[0] == 0
    assert [p.suffix for p in (tmp_path / "out").iterdir()] == [".html"]


@pytest.mark.parametrize("kind", ["cut", "cut, then zeros", "zeros behind the end"])
def test_a_torn_log_is_shown_exported_with_a_note_and_mended_to_be_sound(
    run: Callable[..., tuple[int, str, str]], tmp_path: Path, whole: bytes, kind: str
) -> None:
    log = tmp_path / "a.mcap"
    log.write_bytes(whole if kind.startswith("zeros") else whole[: len(whole) // 2])
    if "zeros" in kind:
        with log.open("r+b") as file:
            file.truncate(HUGE)
    status, out, _ = run("info", log)
    assert status == 0
    assert "it is torn" in out
    status, out, _ = run("check", log)
    assert (status, out.count("not sound")) == (1, 1)
    assert f"repair it: quadlab log recover {log}" in out
    status, out, _ = run("export", log)
    assert status == 0
    assert ("the log is incomplete" in out) is not kind.startswith("zeros"), (
        "all messages are there"
    )
    status, _, complaint = run("replay", log)
    assert (status, complaint.count("\n")) == (1, 1)
    assert "repairs it" in complaint
    assert run("recover", log)[0] == 0
    assert run("check", log)[0] == 0
    assert log.stat().st_size < 2 * len(whole)


def test_check_and_recover_agree_on_a_damaged_chunk(
    run: Callable[..., tuple[int, str, str]], tmp_path: Path
) -> None:
    log = tmp_path / "a.mcap"
    with LogWriter(log, {"vehicle": "q"}, {}) as writer:
        for k in range(2000):
            stamp = START + k * 2_000_000
            message = encode(new("sensor_msgs/Imu", header=header(stamp)))
            writer.write("/q/imu", "sensor_msgs/Imu", message, stamp, stamp)
    with log.open("rb") as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[1]  # type: ignore[union-attr]
    data = bytearray(log.read_bytes())
    data[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 0xFF
    log.write_bytes(data)
    status, out, _ = run("check", log)
    assert (status, out) == (1, "not sound: 1 damaged chunks, whose messages are lost\n")
    first, last = ((ns - START) * 1e-9 for ns in (chunk.message_start_time, chunk.message_end_time))
    status, out, complaint = run("recover", log)
    [which, rest] = out.splitlines()
    assert (status, complaint) == (1, "")
    assert which == (
        f"damaged, and cannot be repaired: a chunk of {chunk.chunk_length} bytes at byte "
        f"{chunk.chunk_start_offset}, with the messages from {first:.3f} to {last:.3f} s"
    )
    assert "nothing was changed" in rest
    assert "whole" not in rest
    assert log.read_bytes() == data


def test_two_logs_in_one_file_are_not_mended_by_dropping_the_second(
    run: Callable[..., tuple[int, str, str]], tmp_path: Path, whole: bytes
) -> None:
    log = tmp_path / "a.mcap"
    log.write_bytes(whole + whole)
    status, _, complaint = run("recover", log)
    assert (status, complaint.count("\n")) == (1, 1)
    assert f"the second begins at byte {len(whole)}" in complaint
    assert log.read_bytes() == whole + whole


DEEP = 100_000
NESTED = {
    "arrays": b"[" * DEEP + b"]" * DEEP,
    "names": b'{"vehicle":' * DEEP + b"1" + b"}" * DEEP,
    "cut": b"[" * DEEP,
    "no names": b"[1, 2]",
    "value": b'{"model.mass": ' + b"[" * DEEP + b"]" * DEEP + b"}",
}


@pytest.mark.parametrize("kind", NESTED)
@pytest.mark.parametrize("command", COMMANDS)
def test_attached_parameters_that_are_none_cost_a_line_at_most(
    run: Callable[..., tuple[int, str, str]], tmp_path: Path, kind: str, command: str
) -> None:
    log = tmp_path / "a.mcap"
    with LogWriter(log, {"vehicle": "q"}, {"parameters.json": NESTED[kind]}) as writer:
        for k in range(100):
            stamp = START + k * 2_000_000
            message = encode(new("sensor_msgs/Imu", header=header(stamp, "q/body")))
            writer.write("/q/imu", "sensor_msgs/Imu", message, stamp, stamp)
    status, _, complaint = run(command, log)
    assert status == (1 if command == "replay" else 0)
    assert complaint.count("\n") == status
    assert ("its parameters are not this version's" in complaint) is (command == "replay")


@pytest.mark.parametrize("text", ["(" * 150, "-" * 90_000 + "1", "1" * 9000, "f'{1}'", "\0", "b.c"])
def test_a_parameters_value_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"\S"):
        literal_value(text)


def test_info_is_told_as_json_too(
    tmp_path: Path, whole: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "a.mcap"
    log.write_bytes(whole)
    assert main(["log", "info", str(log), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["messages"], told["closed"], told["tear"]) == (200, True, "")
    assert told["topics"]["/q/imu"]["type"] == "sensor_msgs/msg/Imu"
    assert told["topics"]["/q/imu"]["rate"] == pytest.approx(500.0, rel=0.01)
    assert told["run"]["vehicle"] == "q"
    assert told["attachments"] == {"parameters.json": 2}
