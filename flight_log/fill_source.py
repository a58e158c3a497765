"""Stretches of the vehicle's own log, as they were fetched: their messages, chunk by chunk."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from mcap.opcode import Opcode

from flight_log.format import MESSAGE, RECORD, TIMES, UNREADABLE, opened
from flight_log.run_index import FILLED_TOPICS
from quadrotor.errors import LogFormatError, StorageError


@dataclass(frozen=True)
class FillSource:
    """A source for filling: one file on board.

    Attributes:
        name: on board.
        path: a file with the same bytes at the same places, as far as they were fetched.
        ranges: (begin, end) of whole records in it, in order and apart.
        channels: id → (topic with namespace, type).
    """

    name: str
    path: Path
    ranges: tuple[tuple[int, int], ...]
    channels: dict[int, tuple[str, str]]


class Onboard(NamedTuple):
    """A message as the vehicle logged it; both times are of its clock."""

    topic: str  # without namespace
    type_name: str
    stamp_ns: int
    payload: bytes


@dataclass
class Damage:
    """Chunks that cannot be read, as spans of the vehicle's clock."""

    spans: list[tuple[int, int]]


def chunks_of(source: FillSource, damage: Damage) -> Iterator[list[Onboard]]:
    """Yield messages of FILLED_TOPICS, a list a chunk, in the order of the file. Raises
    StorageError.
    """
    wanted = {
        number: (name, type_name)
        for number, (topic, type_name) in source.channels.items()
        if (name := topic.rsplit("/", 1)[-1]) in FILLED_TOPICS
    }
    try:
        with source.path.open("rb") as stream:
            for begin, end in source.ranges:
                for chunk in _chunks(stream.fileno(), begin, end):
                    try:
                        data = opened(source.name, chunk)
                        found = list(_split(data, wanted))
                    except (*UNREADABLE, LogFormatError):
                        damage.spans.append(TIMES.unpack_from(chunk))
                        continue
                    yield found
    except OSError as error:
        raise StorageError(f"cannot read {source.path}: {error.strerror}") from error


def _chunks(file: int, place: int, end: int) -> Iterator[bytes]:
    while place + RECORD.size <= end:
        opcode, length = RECORD.unpack(os.pread(file, RECORD.size, place))
        place += RECORD.size
        if opcode in (0, Opcode.DATA_END) or place + length > end:
            return
        if opcode == Opcode.CHUNK:
            yield os.pread(file, length, place)
        place += length


def _split(data: bytes, wanted: dict[int, tuple[str, str]]) -> Iterator[Onboard]:
    place = 0
    while place < len(data):
        opcode, length = RECORD.unpack_from(data, place)
        place += RECORD.size
        if place + length > len(data):
            raise ValueError("record longer than its chunk")
        if opcode == Opcode.MESSAGE:
            channel, _, _, stamp_ns = MESSAGE.unpack_from(data, place)
            if channel in wanted:
                payload = data[place + MESSAGE.size : place + length]
                yield Onboard(*wanted[channel], stamp_ns, payload)
        place += length
