"""A log's columns gathered topic by topic, in arrays that grow in place: no copy of a long log."""

from __future__ import annotations

from array import array
from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vehicle_link.log.topic_columns import ColumnReader, Columns

Floats = npt.NDArray[np.float32]
Stamps = npt.NDArray[np.int64]


class ColumnSpool:
    """N messages of one topic, in the order they were written.

    Args:
        most_payloads: how many payloads of a topic wanted whole are kept.

    Attributes:
        texts: of each the places (index, text) where it changes.
    """

    def __init__(self, type_name: str, most_payloads: int) -> None:
        self.type_name = type_name
        self.payloads: list[bytes] = []
        self.texts: dict[str, list[tuple[int, str]]] = {}
        self._most_payloads = most_payloads
        self._stamps = array("q"), array("q")  # of the log, of the source
        self._numbers: dict[str, array[float]] = {}

    def __len__(self) -> int:
        return len(self._stamps[0])

    def extend(self, columns: Columns) -> None:
        begin, count = len(self), len(columns.log_ns)
        self.payloads += columns.payloads[: self._most_payloads - len(self.payloads)]
        for one, stamps in zip(self._stamps, (columns.log_ns, columns.publish_ns), strict=True):
            one.frombytes(stamps.tobytes())
        for name in columns.numbers.keys() - self._numbers.keys():
            self._numbers[name] = array("f", np.full(begin, np.nan, np.float32).tobytes())
        for name, column in self._numbers.items():
            values = columns.numbers.get(name)
            if values is None:
                values = np.full(count, np.nan, np.float32)
            column.frombytes(values.tobytes())
        for name, told in columns.texts.items():
            self.texts.setdefault(name, []).extend((begin + index, text) for index, text in told)

    @property
    def log_ns(self) -> Stamps:
        """(N,) reception at the writer."""
        return np.frombuffer(self._stamps[0], np.int64)

    @property
    def publish_ns(self) -> Stamps:
        """(N,) the source's stamp."""
        return np.frombuffer(self._stamps[1], np.int64)

    @property
    def numbers(self) -> dict[str, Floats]:
        """(N,) each, NaN where there is none; to be taken when all is read."""
        return {name: np.frombuffer(one, np.float32) for name, one in self._numbers.items()}

    def rows(self, names: Collection[str]) -> Floats:
        """(N, len(names)); NaN for a number that the topic has not."""
        out = np.full((len(self), len(names)), np.nan, np.float32)
        for k, name in enumerate(names):
            if name in self._numbers:
                out[:, k] = np.frombuffer(self._numbers[name], np.float32)
        return out


def gather(reader: ColumnReader, most_payloads: int = 1_000_000) -> dict[str, ColumnSpool]:
    """Everything that `reader` gives, by topic. Raises as it does."""
    spools: dict[str, ColumnSpool] = {}
    for batch in reader:
        for columns in batch.columns:
            if columns.topic not in spools:
                spools[columns.topic] = ColumnSpool(columns.type_name, most_payloads)
            spools[columns.topic].extend(columns)
    return spools


def read_spools(
    log: Path, vehicle: str, wanted: Mapping[str, Collection[str]], whole: tuple[str, ...] = ()
) -> dict[str, ColumnSpool]:
    """Of one vehicle, by name without namespace; a topic without messages is empty.

    Args:
        wanted: paths of numbers and texts by topic.
        whole: of these topics, ends of their names, the payloads.

    Raises LogFormatError or StorageError.
    """
    found = gather(ColumnReader(log, whole, wanted))
    names = {*wanted, *(one.lstrip("/") for one in whole)}
    return {name: found.get(f"/{vehicle}/{name}") or ColumnSpool("", 0) for name in names}
