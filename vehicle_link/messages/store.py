"""The type store: ROS 2 Jazzy's messages, quadlab_msgs and the services, read from the files here;
the names of its types, and messages to CDR and back.

The folders follow a ROS 2 package (`quadlab_msgs/msg/*.msg`, `quadlab_msgs/srv/*.srv`), so that
the same files build the ROS package. rosbags ships no services: those of `rcl_interfaces` used
by `ros2 param` are here too.
"""

from __future__ import annotations

import os
import pickle
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xxhash
from rosbags.serde import SerdeError

from quadrotor.errors import LinkError, UsageError

if TYPE_CHECKING:
    from rosbags.interfaces.typing import Typesdict
    from rosbags.typesys.store import Typestore

    from vehicle_link.messages.construct import Message

FOLDER = Path(__file__).parent


class _Classes(dict[str, Any]):
    """The messages' classes by name, each made when it is first used."""

    def __init__(self, definitions: Typesdict) -> None:
        super().__init__()
        self._definitions = definitions

    def __contains__(self, name: object) -> bool:
        return name in self._definitions

    def __missing__(self, name: str) -> Any:
        from rosbags.typesys.store import Typestore

        maker = Typestore()
        maker.register({name: self._definitions[name]})
        return self.setdefault(name, maker.types[name])


@cache
def typestore() -> Typestore:
    """Return the one store of the process, made on first use."""
    from rosbags.typesys.store import Typestore

    store = Typestore()
    store.fielddefs = _definitions()
    store.types = _Classes(store.fielddefs)
    return store


def _definitions() -> Typesdict:
    """Return ROS 2's types and ours. To read them takes 0.2 s, so they are kept next to Python's
    compiled files, under a digest of ours and of the installed rosbags.
    """
    import rosbags.typesys.stores as shipped

    version = Path(shipped.__file__).with_name("ros2_jazzy.py").stat()
    texts = {path: path.read_text() for path in sorted(FOLDER.glob("*/*/*.[ms][sr][gv]"))}
    state = repr((version.st_size, version.st_mtime_ns, sorted(texts.items()))).encode()
    kept = FOLDER / "__pycache__" / f"types-{xxhash.xxh3_64_hexdigest(state)}.pickle"
    with suppress(OSError, EOFError, pickle.UnpicklingError):
        found: Typesdict = pickle.loads(kept.read_bytes())
        return found
    made = _read(texts)
    with suppress(OSError):  # a folder that cannot be written
        kept.parent.mkdir(exist_ok=True)
        for old in kept.parent.glob("types-*.pickle"):
            old.unlink(missing_ok=True)
        new = kept.with_suffix(f".{os.getpid()}")
        new.write_bytes(pickle.dumps(made))
        new.replace(kept)
    return made


def _read(texts: Mapping[Path, str]) -> Typesdict:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    added: Typesdict = {}
    for path, text in texts.items():
        package, name = path.parts[-3], path.stem
        if path.suffix == ".msg":
            added.update(get_types_from_msg(text, f"{package}/msg/{name}"))
            continue
        # A line "---" separates request and response; either may be empty.
        parts = zip(f"\n{text}".split("\n---\n"), ("Request", "Response"), strict=True)
        for one, part in parts:
            added.update(get_types_from_msg(one, f"{package}/srv/{name}_{part}"))
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(added)
    return store.fielddefs


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


def decode(payload: bytes | memoryview, type_name: str) -> Message:
    """Decode a message from CDR. Raises LinkError when the bytes are no message of this type."""
    try:
        return typestore().deserialize_cdr(payload, stored_name(type_name))
    except (SerdeError, AssertionError, IndexError, TypeError, UsageError) as error:
        raise LinkError(
            f"{len(payload)} bytes are not a {type_name} ({error}); "
            "do both ends run the same version of quadlab?"
        ) from error


@cache
def definition(type_name: str) -> str:
    """Return the ros2msg schema text of a message, with the definitions it depends on."""
    return typestore().generate_msgdef(stored_name(type_name), ros_version=2)[0]
