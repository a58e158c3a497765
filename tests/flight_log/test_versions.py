"""Logs of an older version: messages whose fields have changed since are read by the old type."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from console.reports.run_log import read_run
from flight_log import read_log
from flight_log.attached import logged_value
from quadrotor.errors import LogFormatError
from vehicle_link.messages import decode, new, stored_name, typestore
from vehicle_link.parameters.messages import to_value

NAME = "quadlab_msgs/msg/ParameterChange"
TEXTS = """std_msgs/Header header
string name
# as Python would print them
string old_value
string new_value
string requester
uint32 revision
"""
START = 1_700_000_000_000_000_000


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Return a log with one change of a version that wrote values as texts."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(TEXTS, NAME))
    header = new("std_msgs/Header", stamp={"sec": START // 10**9, "nanosec": 0})
    change = store.types[NAME](header, "estimation.source", "'poses'", "'bearings'", "ada", 7)
    payload = bytes(store.serialize_cdr(change, NAME))
    path = tmp_path / "old.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(profile="ros2")
        text, _ = store.generate_msgdef(NAME, ros_version=2)
        schema = writer.register_schema(NAME, "ros2msg", text.encode())
        channel = writer.register_channel("/quad1/parameter_changes", "cdr", schema)
        writer.add_message(channel, START, payload, START)
        writer.finish()
    return path


def test_a_change_written_as_texts_is_read_by_its_own_fields(log: Path) -> None:
    (message,) = read_log(log)
    change: Any = decode(message.payload, message.type_name)
    assert (change.name, change.requester, change.revision) == ("estimation.source", "ada", 7)
    assert logged_value(change.new_value) == "bearings"


def test_reading_it_leaves_the_types_of_this_version(log: Path) -> None:
    for _ in range(2):
        list(read_log(log))
    ours = typestore().fielddefs[stored_name("quadlab_msgs/ParameterChange")]
    assert [name for name, _ in ours[1]][-1] == "instance"
    assert sum(name.startswith(NAME) for name in typestore().fielddefs) == 2


def test_reports_show_the_change(log: Path) -> None:
    (line,) = [one for one in read_run(log).lines if one.kind == "parameter"]
    assert line.text == "estimation.source: 'poses' → 'bearings'"
    assert line.who == "ada"


@pytest.mark.parametrize("value", [1, 2.5, True, "wide", "'quoted'"])
def test_a_typed_value_is_read_as_it_is(value: int | float | str) -> None:
    assert logged_value(to_value(value)) == value


@pytest.mark.parametrize("value", ["[1]", "b.c", "(" * 150])
def test_a_text_that_is_no_value_is_refused(value: str) -> None:
    with pytest.raises(LogFormatError):
        logged_value(value)
