"""RIHS01 hashes of messages and services, which are part of every Zenoh key and MCAP channel."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from vehicle_link.messages.store import ros_name, stored_name, typestore

if TYPE_CHECKING:
    from rosbags.interfaces.typing import Typesdict


@cache
def type_hash(type_name: str) -> str:
    """Return `RIHS01_…` of a message (`nav_msgs/Odometry`) or a service
    (`quadlab_msgs/srv/Command`).
    """
    name = ros_name(type_name)
    if "/srv/" in name and not name.endswith(("_Request", "_Response")):
        return _service_hash(name)
    return typestore().hash_rihs01(stored_name(type_name))


def _service_hash(name: str) -> str:
    """Return the hash of the description rosidl derives from a .srv file.

    A service is described as a message of its request, its response and its event, the event
    being (info, at most one request, at most one response).
    """
    from rosbags.interfaces import Nodetype
    from rosbags.typesys.store import Typestore

    def one(nested: str) -> Any:
        return (Nodetype.NAME, nested)

    def at_most_one(nested: str) -> Any:
        return (Nodetype.SEQUENCE, ((Nodetype.NAME, nested), 1))

    known: Typesdict = typestore().fielddefs
    scratch = Typestore()
    scratch.fielddefs.update(known)
    # rosidl turns `char` into uint8 before it hashes; rosbags keeps it.
    constants, info = known["service_msgs/msg/ServiceEventInfo"]
    octets: Any = (Nodetype.ARRAY, ((Nodetype.BASE, ("uint8", 0)), 16))
    scratch.fielddefs["service_msgs/msg/ServiceEventInfo"] = (
        constants,
        [(field, octets if field == "client_gid" else entry) for field, entry in info],
    )
    for part in ("Request", "Response"):
        scratch.fielddefs[f"{name}_{part}"] = known[stored_name(f"{name}_{part}")]
    scratch.fielddefs[f"{name}_Event"] = (
        [],
        [
            ("info", one("service_msgs/msg/ServiceEventInfo")),
            ("request", at_most_one(f"{name}_Request")),
            ("response", at_most_one(f"{name}_Response")),
        ],
    )
    scratch.fielddefs[name] = (
        [],
        [
            ("request_message", one(f"{name}_Request")),
            ("response_message", one(f"{name}_Response")),
            ("event_message", one(f"{name}_Event")),
        ],
    )
    return scratch.hash_rihs01(name)
