"""Messages of quadlab: ROS 2 Jazzy's and quadlab_msgs, to and from CDR.

The same bytes go on the wire and into the log, so a message is serialised once.
`TYPESTORE` (a rosbags Typestore) is made on first use, because it costs 0.2 s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from vehicle_link.messages.construct import header, new, stamp_of, time_message
from vehicle_link.messages.records import Message
from vehicle_link.messages.store import (
    dds_name,
    decode,
    definition,
    encode,
    ros_name,
    stored_name,
    typestore,
)
from vehicle_link.messages.type_hash import type_hash

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

    TYPESTORE: Typestore

__all__ = [
    "TYPESTORE",
    "Message",
    "dds_name",
    "decode",
    "definition",
    "encode",
    "header",
    "new",
    "ros_name",
    "stamp_of",
    "stored_name",
    "time_message",
    "type_hash",
    "typestore",
]


def __getattr__(name: str) -> Typestore:
    if name == "TYPESTORE":
        return typestore()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
