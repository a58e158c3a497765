"""The files of the vehicle's log, requested over the link at the lowest priority."""

from __future__ import annotations

import re
import zlib
from dataclasses import dataclass
from typing import Any

from quadrotor.errors import LinkError, RefusedError
from vehicle_link.messages.records import OnboardFile
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.node import Node

PIECE = 2800
"""Bytes of an answer; messages of the flight are always sent between two of them."""
TIMEOUT = 3.0
SUM_TIMEOUT = 60.0
"""Timeout in s; the vehicle reads the whole file for its checksum."""
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,150}\.mcap")


@dataclass(frozen=True, slots=True)
class VehicleFile:
    """A log on board; times are of the vehicle's clock, 0 when unknown."""

    name: str
    size: int
    identity: int  # of its content
    start_ns: int
    end_ns: int
    closed: bool
    recovered: bool = False


class VehicleFiles:
    """The files of the vehicle of `node`; thread-safe.

    Every method raises LinkError without an answer, RefusedError with the vehicle's reason.
    """

    def __init__(self, node: Node) -> None:
        self._clients = {
            name: node.client(name, SERVICES[name], priority="background")
            for name in ("onboard_files", "onboard_part")
        }

    def files(self) -> list[VehicleFile]:
        """Return the files, newest first."""
        return [_file(one) for one in self._ask("onboard_files").files]

    def part(self, name: str, offset: int, length: int) -> tuple[VehicleFile, bytes]:
        answer = self._ask("onboard_part", name=name, offset=offset, length=length)
        data = bytes(answer.data)
        if zlib.crc32(data) != int(answer.crc32):
            raise LinkError(f"{len(data)} bytes of {name} at {offset} arrived damaged")
        return _file(answer.file), data

    def sha256(self, name: str) -> tuple[VehicleFile, bytes]:
        answer = self._ask("onboard_part", SUM_TIMEOUT, name=name, offset=0, length=0)
        return _file(answer.file), bytes(answer.sha256)

    def why_open(self, file: VehicleFile) -> str:
        """Return why a file is not closed; for a torn one the vehicle reports when it
        is repaired.
        """
        name = check_name(file.name)
        if file.start_ns:
            return f"{name} is still being written on board; it is fetched when it is closed"
        try:
            self.sha256(name)
        except RefusedError as error:
            return str(error)
        return f"{name} is not closed on board yet; it is fetched when it is"

    def _ask(self, service: str, timeout: float = TIMEOUT, **fields: Any) -> Any:
        return self._clients[service].ask("station", timeout=timeout, **fields)


def check_name(name: str) -> str:
    """Return a name from outside after checking that it can be a log's. Raises RefusedError."""
    if not NAME.fullmatch(name):
        raise RefusedError(f"{name!r:.80} is not the name of a log; logs on board end in .mcap")
    return name


def _file(message: OnboardFile) -> VehicleFile:
    return VehicleFile(**{name: getattr(message, name) for name in VehicleFile.__slots__})
