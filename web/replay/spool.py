"""Columns on their way from the log to the cache: to the disk block by block.

Most numbers of a log never change (covariances, counters of what did not happen): a column costs
nothing until its first other value.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float32]


class ColumnSpool:
    """One column; `path` is made when a second value comes."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._first = np.float32(np.nan)
        self._is_spooled = False
        self.count = 0

    @property
    def constant(self) -> float | None:
        """Return the one value it has, NaN for none at all; None if it has several."""
        return None if self._is_spooled else float(self._first)

    def extend(self, values: Floats) -> None:
        """More values, shape (N,)."""
        if len(values) == 0:
            return
        if not self._is_spooled:
            if self.count == 0:
                self._first = values[0]
            same = np.isnan(values) if np.isnan(self._first) else values == self._first
            if same.all():
                self.count += len(values)
                return
            self._is_spooled = True
            append(self._path, np.full(self.count, self._first, np.float32))
        append(self._path, values.astype(np.float32, copy=False))
        self.count += len(values)

    def fill(self, count: int) -> None:
        """NaN up to `count` values: messages without this number."""
        if count > self.count:
            self.extend(np.full(count - self.count, np.nan, np.float32))

    def read(self) -> Floats:
        """Return all of it, shape (count,)."""
        if not self._is_spooled:
            return np.full(self.count, self._first, np.float32)
        return np.fromfile(self._path, np.float32)


class TopicSpool:
    """One topic's columns, stamps and changing texts."""

    def __init__(self, folder: Path, topic: str, type_name: str) -> None:
        self.topic = topic
        self.type_name = type_name
        self.count = 0
        self.columns: dict[str, ColumnSpool] = {}
        self.texts: dict[str, list[tuple[int, str]]] = {}  # index, text from there on
        self.payloads: list[bytes] = []
        self._folder = folder

    def extend(self, columns: Any, room: int) -> int:
        """Add one block's `flight_log.topic_columns.Columns`; at most `room` new columns.

        Returns how many columns are new.
        """
        made = 0
        append(self._folder / "log", columns.log_ns)
        append(self._folder / "publish", columns.publish_ns)
        for path, values in columns.numbers.items():
            column = self.columns.get(path)
            if column is None:
                if made >= room:
                    continue
                made += 1
                column = self.columns[path] = ColumnSpool(self._folder / f"{len(self.columns)}")
            column.fill(self.count)
            column.extend(values)
        for path, changes in columns.texts.items():
            kept = self.texts.setdefault(path, [])
            kept += [(self.count + index, text) for index, text in changes]
        self.payloads += columns.payloads
        self.count += len(columns.log_ns)
        return made

    def close(self) -> None:
        """All columns as long as the topic."""
        for column in self.columns.values():
            column.fill(self.count)

    def stamps(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Return reception and source's stamps, ns."""
        return (
            np.fromfile(self._folder / "log", np.int64),
            np.fromfile(self._folder / "publish", np.int64),
        )


def append(path: Path, values: npt.NDArray[Any]) -> None:
    """Raise OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("ab") as file:
        values.tofile(file)
