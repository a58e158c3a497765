"""Columns of bags are the numbers that the library of bags reads."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

from extensions.importers.importing import read_flight
from extensions.importers.mapping import load_mapping
from extensions.importers.readers import ros_bags
from extensions.importers.readers.mcap_tables import McapTables
from extensions.importers.readers.ros_bags import BagTables
from extensions.importers.tests.bag_writer import write_bag
from extensions.importers.tests.foreign_flight import make_flight
from quadrotor.errors import LogFormatError, UsageError

EPOCH_NS = 1_700_000_000_000_000_000
KIND = "sensor_msgs/msg/JointState"


@pytest.mark.parametrize("version", [1, 2])
def test_messages_with_texts_and_arrays_of_any_length_are_read(
    tmp_path: Path, version: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros_bags, "PIECE", 40)
    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_JAZZY)
    header, time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    path = tmp_path / ("joints.bag" if version == 1 else "joints")
    writer: Any = rosbag1.Writer(path) if version == 1 else rosbag2.Writer(path, version=9)
    random = np.random.default_rng(version)
    encode = store.serialize_ros1 if version == 1 else store.serialize_cdr
    expected = []
    with writer:
        link = writer.add_connection("/joints", KIND, typestore=store)
        for k in range(100):
            count = int(random.integers(1, 4))
            names = ["n" * int(random.integers(0, 9)) for _ in range(count)]
            position, effort = random.normal(size=count), random.normal(size=2)
            more = {"seq": k} if version == 1 else {}
            head = header(stamp=time(sec=k, nanosec=7 * k), frame_id="f" * (k % 5), **more)
            message = store.types[KIND](head, names, position, np.zeros(0), effort)
            writer.write(link, 1000 + k, encode(message, KIND))
            second = position[1] if count > 1 else np.nan
            expected.append([k, position[0], second, *effort, 1e-9 * (1000 + k)])
    rows = np.array(expected)
    columns = ["stamp", "position[0]", "position[1]", "effort[0]", "effort[1]", "logged"]
    table = BagTables(path, {"/joints"})
    assert table.tables() == ["/joints"]
    named = [one for one in columns if one in table.columns("/joints")]
    assert set(columns) - set(named) <= {"position[1]"}
    found = table.read("/joints", named)
    rows = rows[:, [columns.index(one) for one in named]]
    rows[:, 0] += 7e-9 * rows[:, 0]
    np.testing.assert_allclose(found, rows, rtol=1e-15)


def test_of_a_topic_with_two_types_the_usual_one_is_read(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    kinds = {"std_msgs/msg/Float64": 2.5, "std_msgs/msg/Int32": 7}
    with rosbag1.Writer(tmp_path / "two.bag") as writer:
        for count, (kind, value) in zip((30, 3), kinds.items(), strict=True):
            link = writer.add_connection("/level", kind, typestore=store)
            data = store.serialize_ros1(store.types[kind](value), kind)
            for k in range(count):
                writer.write(link, 1000 + k, data)
    with (tmp_path / "two.mcap").open("wb") as file:
        mcap = Writer(file)
        mcap.start("ros2", "another")
        number, whole = np.array(2.5, "<f8").tobytes(), np.array(7, "<i4").tobytes()
        for kind, text, body, count in (
            ("std_msgs/msg/Float64", b"float64 data", number, 20),
            ("std_msgs/Float64", b"float64 data", number, 10),  # the same one, as some write it
            ("std_msgs/msg/Int32", b"int32 data", whole, 3),
        ):
            schema = mcap.register_schema(kind, "ros2msg", text)
            channel = mcap.register_channel("/level", "cdr", schema)
            for k in range(count):
                mcap.add_message(channel, 1000 + k, b"\0\1\0\0" + body, 1000 + k)
        mcap.finish()
    for table in (
        BagTables(tmp_path / "two.bag", {"/level"}),
        McapTables(tmp_path / "two.mcap", {"/level"}),
    ):
        assert (table.read("/level", ["data"])[:, 0] == np.full(30, 2.5)).all()
        [note] = table.notes
        assert "3 messages of /level are of std_msgs/" in note
        assert "Int32, most of it of std_msgs/" in note


def test_a_damaged_bag_advises_only_what_can_work(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", make_flight(seconds=1.0), 2)
    data = (bag / "bag.db3").read_bytes()
    (bag / "bag.db3").write_bytes(data[: len(data) // 2])
    with pytest.raises(LogFormatError, match=r"malformed; sqlite3 bag.db3 .recover may save"):
        BagTables(bag, {"/imu"})
    (bag / "other.db3").write_bytes(data)
    with pytest.raises(LogFormatError, match=r"malformed; try other.db3 in it alone"):
        BagTables(bag, {"/imu"})
    (bag / "other.db3").unlink()
    with closing(sqlite3.connect(bag / "bag.db3.new")) as endless:
        endless.execute(
            "CREATE VIEW messages AS WITH RECURSIVE all_of (id) AS "
            "(SELECT 1 UNION ALL SELECT id + 1 FROM all_of) SELECT 0 AS data FROM all_of"
        )
    (bag / "bag.db3.new").replace(bag / "bag.db3")
    with pytest.raises(LogFormatError, match=r"missing tables.*; sqlite3 bag.db3 .recover"):
        BagTables(bag, {"/imu"})


def test_topics_have_the_stamps_that_are_asked_for(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    vector, time = types["geometry_msgs/msg/Vector3"], types["builtin_interfaces/msg/Time"]
    turned, none = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0), np.zeros(9)
    kinds = {"/imu": "sensor_msgs/msg/Imu", "/clock": "rosgraph_msgs/msg/Clock"}
    with rosbag2.Writer(tmp_path / "bag", version=9) as writer:
        links = {one: writer.add_connection(one, kinds[one], typestore=store) for one in kinds}
        for k in range(100):
            head = types["std_msgs/msg/Header"](time(9, 10_000_000 * k), "")
            rate, force = vector(0.1, 0.0, 0.0), vector(0.0, 0.0, 9.8)
            sample = types[kinds["/imu"]](head, turned, none, rate, none, force, none)
            clock = types[kinds["/clock"]](time(5, 4_000_000 * k))
            for topic, message in (("/imu", sample), ("/clock", clock)):
                data = store.serialize_cdr(message, kinds[topic])
                writer.write(links[topic], EPOCH_NS + 20_000_000 * k, data)
    for choice, step in (("header", 10), ("log", 20), ("clock", 4)):
        found = read_flight(tmp_path / "bag", stamps=choice)
        steps = np.diff(found.imu.stamps_ns)
        np.testing.assert_allclose(steps, step * 1e6, atol=1000)
        assert len(steps) == 99
    assert "stamps clock" in found.source
    with pytest.raises(UsageError, match="no section of the mapping has a topic"):
        load_mapping("euroc").with_stamps("log")


def test_a_bag_whose_recorder_has_not_written_all_of_it_says_so_until_it_has(
    tmp_path: Path,
) -> None:
    bag = write_bag(tmp_path / "bag", make_flight(seconds=1.0), 2)
    [database] = bag.glob("*.db3")
    recorder = sqlite3.connect(database)
    recorder.execute("PRAGMA journal_mode=wal")
    recorder.execute("PRAGMA wal_autocheckpoint=0")
    recorder.execute("DELETE FROM messages WHERE id > 150")
    recorder.commit()
    with pytest.raises(LogFormatError, match=r"-wal has what is not in bag\.db3 yet.*--torn"):
        read_flight(bag)
    assert len(read_flight(bag, torn=True).imu.stamps_ns) == 100
    recorder.close()
    assert len(read_flight(bag).imu.stamps_ns) == 75
