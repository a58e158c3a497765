"""Messages to CDR bytes and back, and the schema text that goes into the log."""

from __future__ import annotations

from functools import cache

from rosbags.serde import SerdeError

from quadrotor.errors import LinkError, UsageError
from vehicle_link.messages.construct import Message
from vehicle_link.messages.names import stored_name
from vehicle_link.messages.store import typestore


def encode(message: Message) -> bytes:
    """Encode as CDR with its 4-byte header, little endian."""
    return bytes(typestore().serialize_cdr(message, message.__msgtype__, little_endian=True))


def decode(payload: bytes | memoryview, type_name: str) -> Message:
    """Decode a message from CDR. Raises LinkError when the bytes are no message of this type."""
    try:
        return typestore().deserialize_cdr(payload, stored_name(type_name))
    except (SerdeError, AssertionError, IndexError, TypeError, UsageError) as error:
        raise LinkError(
            f"{len(payload)} bytes are no {type_name} ({error}); "
            "do both ends run the same version of quadlab?"
        ) from error


@cache
def definition(type_name: str) -> str:
    """Return the ros2msg schema text of a message, with the definitions it depends on."""
    return typestore().generate_msgdef(stored_name(type_name), ros_version=2)[0]
