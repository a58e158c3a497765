"""The type store: ROS 2 Jazzy's messages, quadlab_msgs and the services, read from the files here.

The folders follow a ROS 2 package (`quadlab_msgs/msg/*.msg`, `quadlab_msgs/srv/*.srv`), so that
the same files build the ROS package. rosbags ships no services: those of `rcl_interfaces` used
by `ros2 param` are here too.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rosbags.interfaces.typing import Typesdict
    from rosbags.typesys.store import Typestore

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
