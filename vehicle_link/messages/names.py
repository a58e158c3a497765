"""Names of message and service types: what people write, what rosbags stores, what ROS 2 sends."""

from __future__ import annotations

from quadrotor.errors import UsageError


def stored_name(type_name: str) -> str:
    """Return the stored name: `nav_msgs/Odometry` or `nav_msgs/msg/Odometry` →
    `nav_msgs/msg/Odometry`.

    Requests and responses (`quadlab_msgs/srv/Command_Request`) → `quadlab_msgs/srv/msg/…`,
    as rosbags stores them. Raises UsageError.
    """
    match type_name.split("/"):
        case [package, name]:
            return f"{package}/msg/{name}"
        case [_, "msg", _] | [_, "srv", "msg", _]:
            return type_name
        case [package, "srv", name]:
            return f"{package}/srv/msg/{name}"
    raise UsageError(f"{type_name!r} is no type name; write package/Name or package/srv/Name")


def ros_name(type_name: str) -> str:
    """Return the name that ROS 2 tools show: `nav_msgs/msg/Odometry`,
    `quadlab_msgs/srv/Command`.
    """
    return stored_name(type_name).replace("/srv/msg/", "/srv/")


def dds_name(type_name: str) -> str:
    """Return the name in Zenoh keys: `nav_msgs::msg::dds_::Odometry_`."""
    package, kind, name = ros_name(type_name).split("/")
    return f"{package}::{kind}::dds_::{name}_"
