"""No part of `quadlab up` can be reached from another computer."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path
from typing import Any


def sockets_of(process: int) -> set[str]:
    """Return the inodes of a process's sockets."""
    folder, found = Path(f"/proc/{process}/fd"), set[str]()
    for name in os.listdir(folder):
        with suppress(FileNotFoundError):  # closed since it was listed
            if socket := re.fullmatch(r"socket:\[(\d+)\]", os.readlink(folder / name)):
                found.add(socket[1])
    return found


def test_every_socket_of_up_is_bound_to_this_computer(lab: Any) -> None:
    lab.ready()
    inodes = {inode for process in lab.processes() for inode in sockets_of(process)}
    places: dict[str, set[str]] = {"tcp": set(), "udp": set()}
    for table in ("tcp", "udp", "tcp6", "udp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            row = line.split()
            if row[9] in inodes:
                places[table[:3]].add(row[1].partition(":")[0])
    assert places == {"tcp": {"0100007F"}, "udp": {"0100007F"}}
