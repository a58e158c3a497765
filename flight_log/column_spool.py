"""A log's columns gathered topic by topic, in arrays that grow in place: no copy of a long log."""

from __future__ import annotations

import math
from array import array
from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from flight_log.topic_columns import ColumnReader, Columns
from quadrotor.errors import LogFormatError

Floats = npt.NDArray[np.float32]
Stamps = npt.NDArray[np.int64]

OBJECT_BYTES = 80
"""Size of a text or payload besides its letters."""


class ColumnSpool:
    """N messages of one topic, in the order they were written.

    Args:
        most_payloads: how many payloads of a topic wanted whole are kept.
        received: whether the stamps of reception are kept too.

    Attributes:
        texts: of each the places (index, text) where it changes.
    """

    def __init__(self, type_name: str, most_payloads: int, *, received: bool = True) -> None:
        self.type_name = type_name
        self.payloads: list[bytes] = []
        self.texts: dict[str, list[tuple[int, str]]] = {}
        self._most_payloads = most_payloads
        self._received = received
        self._log_ns, self._publish_ns = array("q"), array("q")
        self._numbers: dict[str, array[float]] = {}
        self._written = 0  # bytes of payloads and texts

    def __len__(self) -> int:
        return len(self._publish_ns)

    def extend(self, columns: Columns) -> None:
        begin, count = len(self), len(columns.log_ns)
        payloads = columns.payloads[: self._most_payloads - len(self.payloads)]
        self.payloads += payloads
        self._written += sum(len(one) + OBJECT_BYTES for one in payloads)
        self._publish_ns.frombytes(columns.publish_ns.tobytes())
        if self._received:
            self._log_ns.frombytes(columns.log_ns.tobytes())
        for name in columns.numbers.keys() - self._numbers.keys():
            self._numbers[name] = array("f", np.full(begin, np.nan, np.float32).tobytes())
        for name, column in self._numbers.items():
            values = columns.numbers.get(name)
            if values is None:
                values = np.full(count, np.nan, np.float32)
            column.frombytes(values.tobytes())
        for name, told in columns.texts.items():
            self.texts.setdefault(name, []).extend((begin + index, text) for index, text in told)
            self._written += sum(len(text) + 2 * OBJECT_BYTES for _, text in told)

    @property
    def size(self) -> int:
        """Return bytes it holds; texts as they change."""
        stamps = self._publish_ns.itemsize * (len(self._publish_ns) + len(self._log_ns))
        numbers = sum(one.itemsize * len(one) for one in self._numbers.values())
        return stamps + numbers + self._written

    @property
    def log_ns(self) -> Stamps:
        """Return the stamps of reception at the writer, (N,) ns; empty when they are not kept."""
        return np.frombuffer(self._log_ns, np.int64)

    @property
    def publish_ns(self) -> Stamps:
        """Return the source's stamps, (N,) ns."""
        return np.frombuffer(self._publish_ns, np.int64)

    def give_up_stamps(self) -> None:
        """Free the stamps after their last use: of a long log they are most of the memory."""
        self._log_ns, self._publish_ns = array("q"), array("q")

    @property
    def numbers(self) -> dict[str, Floats]:
        """Return the numbers by path, (N,) each, NaN where there is none; to be taken when all is
        read.
        """
        return {name: np.frombuffer(one, np.float32) for name, one in self._numbers.items()}

    def take(self, names: Collection[str]) -> Floats:
        """Return the columns, (N, len(names)), NaN for a number that the topic has not; they are
        freed.
        """
        out = np.full((len(self), len(names)), np.nan, np.float32)
        for k, name in enumerate(names):
            if name in self._numbers:
                out[:, k] = np.frombuffer(self._numbers.pop(name), np.float32)
        return out


def gather(
    reader: ColumnReader,
    most_payloads: int = 1_000_000,
    *,
    received: bool = True,
    most_bytes: float = math.inf,
) -> dict[str, ColumnSpool]:
    """Collect everything that `reader` gives, by topic.

    Raises as it does, and LogFormatError when it is more than `most_bytes`.
    """
    spools: dict[str, ColumnSpool] = {}
    name = reader.log.path.name
    for batch in reader:
        for columns in batch.columns:
            if columns.topic not in spools:
                spools[columns.topic] = ColumnSpool(
                    columns.type_name, most_payloads, received=received
                )
            spools[columns.topic].extend(columns)
        if sum(one.size for one in spools.values()) > most_bytes:
            raise LogFormatError(
                f"{name} has more than {most_bytes / 1e6:.0f} MB of times and values to hold at "
                "once: cut it with `mcap filter --output-compression lz4 --start … --end …`, or "
                "export it with `quadlab log export`"
            )
    return spools


def read_spools(
    log: Path, vehicle: str, wanted: Mapping[str, Collection[str]], whole: tuple[str, ...] = ()
) -> dict[str, ColumnSpool]:
    """Read the topics of one vehicle, by name without namespace; a topic without messages is empty.

    Args:
        wanted: paths of numbers and texts by topic.
        whole: of these topics, ends of their names, the payloads.

    Raises LogFormatError or StorageError.
    """
    found = gather(ColumnReader(log, whole, wanted), received=False)
    names = {*wanted, *(one.lstrip("/") for one in whole)}
    return {name: found.get(f"/{vehicle}/{name}") or ColumnSpool("", 0) for name in names}
