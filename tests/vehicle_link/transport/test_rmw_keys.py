"""Keys and tokens against vectors captured from a live rmw_zenoh."""

from __future__ import annotations

import pytest

from vehicle_link.topics.rmw_keys import (
    RELIABLE,
    SENSOR_DATA,
    NodeIdentity,
    Qos,
    attachment,
    data_key,
    full_name,
    gid_of,
    parse_attachment,
)

TOKEN = (
    "@ros2_lv/0/cb6e75cf8194a4d81370b618e0a4ed07/0/4/MP/%/%/_ros2cli_413596/%chatter/"
    "std_msgs::msg::dds_::String_/"
    "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18/::,10:,:,:,,"
)
GID = bytes.fromhex("1236acd8c8370ad4e6ed96c021a8b85e")
ATTACHMENT = bytes.fromhex("1b0000000000000040a1c53a897cc618101236acd8c8370ad4e6ed96c021a8b85e")


def test_endpoint_token_equals_the_one_of_ros() -> None:
    node = NodeIdentity("cb6e75cf8194a4d81370b618e0a4ed07", 0, "", "_ros2cli_413596")
    assert node.endpoint_token(4, "MP", "/chatter", "std_msgs/String", RELIABLE) == TOKEN


def test_gid_is_the_hash_of_the_token() -> None:
    assert gid_of(TOKEN) == GID


def test_attachment_equals_the_one_of_ros() -> None:
    assert attachment(0x1B, 0x18C67C893AC5A140, GID) == ATTACHMENT
    assert parse_attachment(ATTACHMENT) == (0x1B, 0x18C67C893AC5A140, GID)


@pytest.mark.parametrize(
    "data", [b"", ATTACHMENT[:-1], ATTACHMENT[:16] + b"\x08" + ATTACHMENT[17:]]
)
def test_an_attachment_of_another_kind_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match=r"attachment"):
        parse_attachment(data)


def test_attachment_is_what_zenoh_would_serialise() -> None:
    from zenoh.ext import Int64, z_serialize

    assert z_serialize((Int64(5), Int64(6), GID)).to_bytes() == attachment(5, 6, GID)


def test_data_key_equals_the_one_of_ros() -> None:
    assert data_key(0, "/quad1/state", "nav_msgs/Odometry") == (
        "0/quad1/state/nav_msgs::msg::dds_::Odometry_/"
        "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"
    )
    assert data_key(3, "/quad1/arm", "quadlab_msgs/srv/Command").startswith(
        "3/quad1/arm/quadlab_msgs::srv::dds_::Command_/RIHS01_"
    )


def test_node_token_has_no_endpoint() -> None:
    node = NodeIdentity("ab12", 3, "/quad1", "vehicle", domain=7)
    assert node.token == "@ros2_lv/7/ab12/3/3/NN/%/%quad1/vehicle"


def test_qos_is_written_as_ros_writes_it() -> None:
    assert RELIABLE.text == "::,10:,:,:,,"
    assert SENSOR_DATA.text == "2::,5:,:,:,,"
    assert Qos(latched=True, depth=1).text == ":1:,1:,:,:,,"
    assert Qos(depth=42).text == "::,:,:,:,,"


def test_names_are_relative_unless_they_start_with_a_slash() -> None:
    assert full_name("/quad1", "state") == "/quad1/state"
    assert full_name("", "state") == "/state"
    assert full_name("/quad1", "/quad2/state") == "/quad2/state"
