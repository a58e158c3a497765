"""Messages of a recorded flight on their way to a replay, of which only what it needs is held."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from flight_log import LogMessage
from quadrotor.errors import LogFormatError

AT_ONCE = 4096
"""Messages decoded together."""
MOST_BYTES = 200_000_000
"""Largest size of what is held: half an hour's flight at 400 Hz."""
MESSAGE_BYTES = 400
"""Size of one that is held whole, or as an object, besides its payload."""

Columns = list[npt.NDArray[Any]]
Decode = Callable[[list[bytes]], Columns]


class Gathered:
    """Args: `decode` of the topics, by name, that are held as records; others are held whole."""

    def __init__(self, path: Path, decode: dict[str, Decode]) -> None:
        self._path = path
        self._decode = decode
        self._waiting: dict[str, list[bytes]] = defaultdict(list)
        self._records: dict[str, list[bytearray]] = {}
        self._types: dict[str, list[np.dtype[Any]]] = {}
        self._size = 0
        self.whole: dict[str, list[LogMessage]] = defaultdict(list)

    def add(self, name: str, message: LogMessage) -> None:
        """Add a message. Raises LogFormatError when it is more than is held, and as the decoder
        does.
        """
        if name not in self._decode:
            self.whole[name].append(message)
            self._hold(len(message.payload) + MESSAGE_BYTES)
            return
        waiting = self._waiting[name]
        waiting.append(message.payload)
        if len(waiting) >= AT_ONCE:
            self._flush(name)

    def records(self, name: str) -> Columns:
        """Return the decoded messages of a topic as columns; (N,) each, N may be 0."""
        self._flush(name)
        made = zip(self._records[name], self._types[name], strict=True)
        return [np.frombuffer(data, kind) for data, kind in made]

    def _flush(self, name: str) -> None:
        payloads, self._waiting[name] = self._waiting[name], []
        if not payloads and name in self._types:
            return
        parts = self._decode[name](payloads)
        self._types.setdefault(name, [part.dtype for part in parts])
        held = self._records.setdefault(name, [bytearray() for _ in parts])
        for data, part in zip(held, parts, strict=True):
            data.extend(part.tobytes())
            self._hold(part.nbytes)

    def _hold(self, size: int) -> None:
        self._size += size
        if self._size > MOST_BYTES:
            raise LogFormatError(
                f"{self._path} has more than the {MOST_BYTES // 10**6} MB of samples, states and "
                "measurements that a replay holds: cut it with "
                "`mcap filter --include-attachments --output-compression lz4 --start … --end …`"
            )
