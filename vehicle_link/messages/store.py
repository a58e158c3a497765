"""The type store: ROS 2 Jazzy's messages, quadlab_msgs and the services, read from the files here;
the names of its types, and messages to CDR and back.

The folders follow a ROS 2 package (`quadlab_msgs/msg/*.msg`, `quadlab_msgs/srv/*.srv`), so that
the same files build the ROS package. rosbags ships no services: those of `rcl_interfaces` used
by `ros2 param` are here too.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, cast

from rosbags.serde import SerdeError

from quadrotor.errors import LinkError, UsageError

if TYPE_CHECKING:
    from rosbags.interfaces.typing import Typesdict
    from rosbags.typesys.store import Typestore

    from vehicle_link.messages.records import Decode, Message

FOLDER = Path(__file__).parent


@cache
def typestore() -> Typestore:
    """Return the one store of the process, made on first use (0.2 s, most of it ROS 2's own
    types).
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    added: Typesdict = {}
    for path in sorted(FOLDER.glob("*/msg/*.msg")):
        package = path.parts[-3]
        added.update(get_types_from_msg(path.read_text(), f"{package}/msg/{path.stem}"))
    for path in sorted(FOLDER.glob("*/srv/*.srv")):
        package = path.parts[-3]
        # A line "---" separates request and response; either may be empty.
        request, response = ("\n" + path.read_text()).split("\n---\n")
        for text, part in ((request, "Request"), (response, "Response")):
            added.update(get_types_from_msg(text, f"{package}/srv/{path.stem}_{part}"))
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(added)
    return store


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


def encode(message: Message) -> bytes:
    """Encode as CDR with its 4-byte header, little endian."""
    return bytes(typestore().serialize_cdr(message, message.__msgtype__, little_endian=True))


def _decode(payload: bytes | memoryview, type_name: str) -> Message:
    try:
        return cast("Message", typestore().deserialize_cdr(payload, stored_name(type_name)))
    except (SerdeError, AssertionError, IndexError, TypeError, UsageError) as error:
        raise LinkError(
            f"{len(payload)} bytes are not a {type_name} ({error}); "
            "do both ends run the same version of quadlab?"
        ) from error


decode = cast("Decode", _decode)
"""Decode a message from CDR. Raises LinkError when the bytes are no message of this type."""


@cache
def definition(type_name: str) -> str:
    """Return the ros2msg schema text of a message, with the definitions it depends on."""
    return typestore().generate_msgdef(stored_name(type_name), ros_version=2)[0]
