"""A log whose writer was killed: what was lost, and which readers read the rest.

The writer's process numbers its messages in their source stamps and notes on a board, which
outlives it, how many it has written and when.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from benchmarks.harness import Row, Target
from flight_log.check import check_log
from flight_log.index import RECOVERED_METADATA, is_closed
from flight_log.reader import read_log, read_metadata

MOST_LOST_MS = 50.0
_FIELDS = struct.Struct("<qq")


class Board:
    """A message count that one process writes, and another reads when that one is dead."""

    def __init__(self, path: Path) -> None:
        if not path.exists():
            path.write_bytes(bytes(_FIELDS.size))
        with path.open("r+b") as file:
            self._memory = mmap.mmap(file.fileno(), _FIELDS.size)

    def note(self, count: int, last_ns: int) -> None:
        """Note the number of messages written, and the log time of the last one."""
        _FIELDS.pack_into(self._memory, 0, count, last_ns)

    def read(self) -> tuple[int, int]:
        count, last_ns = _FIELDS.unpack_from(self._memory)
        return count, last_ns


@dataclass(frozen=True)
class Kill:
    """The remains of one killed writer."""

    put: int  # messages
    kept: int
    lost_ms: float  # of data: from the last message in the repaired file to the last one written
    problems: tuple[str, ...]  # of the repaired file


def look(log: Path, board: Board, mend: Callable[[], object]) -> Kill:
    """Repair a log as the next start does, then read it with every reader."""
    put, last_ns = board.read()
    problems = [] if not is_closed(log) else ["it was closed before it was killed"]
    mend()
    if not is_closed(log):
        return Kill(put, 0, np.inf, (*problems, "it was not mended"))
    found = [(message.publish_ns, message.log_ns) for message in read_log(log)]
    numbers = [number for number, _ in found]
    if numbers != list(range(len(found))):
        problems.append("what is left is not all that was put up to its end")
    problems += problems_of(log, len(found))
    lost_ms = (last_ns - found[-1][1]) * 1e-6 if found else np.inf
    return Kill(put, len(found), max(0.0, lost_ms), tuple(problems))


def problems_of(log: Path, count: int) -> list[str]:
    """Return the problems of a repaired file of which we read `count` messages; none if sound."""
    problems = []
    if RECOVERED_METADATA not in read_metadata(log):
        problems.append("it is not marked as mended")
    problems += [line for line in check_log(log).problems if "stamps go back" not in line]
    for reader, its in (("mcap", _by_mcap(log)), ("rosbags", _by_rosbags(log))):
        if its != count:
            problems.append(f"{reader} reads {its} messages of {count}")
    return problems


def summary(what: str, kills: Sequence[Kill]) -> tuple[Row, list[Target], list[str]]:
    """Return one row of the table, its targets, and a line for each problem."""
    lost = [kill.lost_ms for kill in kills]
    bad = [kill for kill in kills if kill.problems]
    sound = len(kills) - len(bad)
    row = Row(
        what,
        {
            "kills": f"{len(kills)}",
            "lost, ms: median": float(np.median(lost)),
            "most": max(lost),
            "messages put": f"{sum(kill.put for kill in kills)}",
            "in the mended files": f"{sum(kill.kept for kill in kills)}",
            "mended, and read by mcap, rosbags, quadlab": f"{sound} of {len(kills)}",
        },
    )
    targets = [
        Target(f"{what}: most data lost, ms", max(lost), MOST_LOST_MS),
        Target(f"{what}: files not mended, or not read by all", len(bad), 0),
    ]
    lines = [f"{what}: {problem}" for kill in bad for problem in kill.problems]
    return row, targets, list(dict.fromkeys(lines))


def _by_mcap(log: Path) -> int:
    with log.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return sum(1 for _ in reader.iter_messages(log_time_order=False))


def _by_rosbags(log: Path) -> int:
    """Return the number of messages that rosbags reads and decodes."""
    with AnyReader([log]) as reader:
        decoded: list[Any] = [
            reader.deserialize(raw, connection.msgtype) for connection, _, raw in reader.messages()
        ]
    return len(decoded)
