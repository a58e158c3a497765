"""Messages: zero filling, bytes, schema text and type hashes."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from quadrotor.errors import LinkError, UsageError
from vehicle_link.messages import (
    TYPESTORE,
    dds_name,
    decode,
    definition,
    encode,
    header,
    new,
    ros_name,
    stamp_of,
    type_hash,
)
from vehicle_link.messages.store import FOLDER

# Captured from ROS 2 Jazzy (rmw_zenoh).
ROS_HASHES = {
    "nav_msgs/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "std_msgs/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "rcl_interfaces/srv/GetParameters": (
        "bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc"
    ),
    "rcl_interfaces/srv/SetParameters": (
        "56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0"
    ),
    "rcl_interfaces/srv/SetParametersAtomically": (
        "0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd"
    ),
    "rcl_interfaces/srv/ListParameters": (
        "3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d"
    ),
    "rcl_interfaces/srv/GetParameterTypes": (
        "da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca"
    ),
    "rcl_interfaces/srv/DescribeParameters": (
        "845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff"
    ),
}


@pytest.mark.parametrize("type_name", ROS_HASHES)
def test_type_hash_equals_the_one_of_ros(type_name: str) -> None:
    assert type_hash(type_name) == f"RIHS01_{ROS_HASHES[type_name]}"


def test_every_quadlab_message_survives_the_wire_when_empty() -> None:
    # Reading an old log adds the types of that time, such as `ParameterChangeVersion0`.
    ours = [
        name
        for name in TYPESTORE.types
        if name.startswith("quadlab_msgs/") and not re.search(r"Version\d+$", name)
    ]
    folder = FOLDER / "quadlab_msgs"
    files = [len(list(folder.glob(f"{kind}/*.{kind}"))) for kind in ("msg", "srv")]
    assert len(ours) == files[0] + 2 * files[1] > 20
    for name in ours:
        payload = encode(new(name))
        assert payload[:4] == b"\x00\x01\x00\x00"
        assert encode(decode(payload, name)) == payload


def test_new_takes_nested_fields_as_sequence_mapping_or_message() -> None:
    message = new(
        "quadlab_msgs/Reference",
        header=header(3_000_000_007, "world"),
        position=(1.0, 2.0, 3.0),
        velocity={"y": 4.0},
        jerk=new("geometry_msgs/Vector3", z=5.0),
        yaw=0.5,
    )
    back = decode(encode(message), "quadlab_msgs/Reference")
    assert stamp_of(back) == 3_000_000_007
    assert (back.header.stamp.sec, back.header.stamp.nanosec) == (3, 7)
    assert (back.position.x, back.position.y, back.position.z) == (1.0, 2.0, 3.0)
    assert (back.velocity.x, back.velocity.y) == (0.0, 4.0)
    assert back.jerk.z == 5.0
    assert back.yaw == 0.5


def test_new_makes_arrays_of_numbers_texts_and_messages() -> None:
    bearings = new("quadlab_msgs/BearingArray", beacon_ids=[4, -2], bearings=[(1, 0, 0), (0, 1, 0)])
    back = decode(encode(bearings), "quadlab_msgs/BearingArray")
    np.testing.assert_array_equal(back.beacon_ids, [4, -2])
    assert [b.y for b in back.bearings] == [0.0, 1.0]
    status = decode(
        encode(new("quadlab_msgs/VehicleStatus", flags=["no_pose"])), "quadlab_msgs/VehicleStatus"
    )
    assert status.flags == ["no_pose"]


def test_new_refuses_a_field_or_type_that_does_not_exist() -> None:
    with pytest.raises(TypeError, match="no field yaw_speed"):
        new("quadlab_msgs/Reference", yaw_speed=1.0)
    with pytest.raises(UsageError, match="unknown message type"):
        new("quadlab_msgs/Nothing")


@pytest.mark.parametrize(
    "payload", [b"", b"\x00\x01\x00\x00\x01", b"\xff" * 64, b"\x00\x01\x00\x00" + b"\xff" * 9]
)
def test_bytes_of_another_type_are_a_link_error(payload: bytes) -> None:
    with pytest.raises(LinkError, match=r"not a quadlab_msgs/VehicleStatus"):
        decode(payload, "quadlab_msgs/VehicleStatus")


def test_definition_holds_the_nested_types() -> None:
    text = definition("quadlab_msgs/Reference")
    assert text.startswith("std_msgs/Header header\n")
    for nested in ("std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Vector3"):
        assert f"MSG: {nested}\n" in text


def test_names_as_ros_and_as_zenoh_write_them() -> None:
    assert ros_name("nav_msgs/Odometry") == "nav_msgs/msg/Odometry"
    assert ros_name("quadlab_msgs/srv/Command") == "quadlab_msgs/srv/Command"
    assert dds_name("nav_msgs/Odometry") == "nav_msgs::msg::dds_::Odometry_"
    assert dds_name("quadlab_msgs/srv/Command") == "quadlab_msgs::srv::dds_::Command_"
    with pytest.raises(UsageError, match="no type name"):
        ros_name("Odometry")


def test_the_ros_package_lists_every_interface_and_each_package_that_they_need() -> None:
    folder = FOLDER / "quadlab_msgs"
    files = [*folder.glob("msg/*.msg"), *folder.glob("srv/*.srv")]
    lines = (folder / "CMakeLists.txt").read_text()
    listed = re.findall(r'^  "(\S+)"$', lines, re.MULTILINE)
    assert sorted(listed) == sorted(str(path.relative_to(folder)) for path in files)
    types = re.compile(r"^([a-z_]+)/[A-Z]\w*(?:\[[^]]*\])? ", re.MULTILINE)
    needed = {package for path in files for package in types.findall(path.read_text())}
    needed -= {"quadlab_msgs"}
    package = ElementTree.parse(folder / "package.xml").getroot()
    assert {depend.text for depend in package.findall("depend")} == needed
    [dependencies] = re.findall(r"^  DEPENDENCIES (.+)$", lines, re.MULTILINE)
    assert set(dependencies.split()) == needed
    assert set(re.findall(r"find_package\((\w+) REQUIRED\)", lines)) == needed | {
        "ament_cmake",
        "rosidl_default_generators",
    }
