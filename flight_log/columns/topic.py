"""The columns of one topic of a log, mapped from its Arrow file."""

from __future__ import annotations

import mmap
from collections.abc import Callable, Collection, Mapping
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from mcap.records import Schema

from flight_log.columns.writer import HEADER, PAYLOAD, RECEIVED, STAMP
from flight_log.payload_layout import HEADER_STAMP
from flight_log.reader import decodable_name
from quadrotor.records import Stamps

NOTHING: dict[str, Any] = {"type": "", "count": 0, "numbers": [], "constants": {}, "texts": {}}

Floats = npt.NDArray[np.floating]


class Topic:
    """N messages of one topic, in the order in which they were written; read on demand.

    Args:
        facts: of the topic, as in `log.json`; none for a topic without messages.
        table: returns its Arrow table and the memory map that holds it.
        dtype: of the numbers.

    Attributes:
        texts: for each text, the rows (index, text) where it changes.
    """

    def __init__(
        self,
        facts: Mapping[str, Any] | None = None,
        table: Callable[[], tuple[Any, mmap.mmap]] | None = None,
        dtype: npt.DTypeLike = np.float32,
        schema: tuple[str, str] | None = None,
    ) -> None:
        self._facts = facts or NOTHING
        self._open, self._schema, self.dtype = table, schema, np.dtype(dtype)
        self.names: list[str] = self._facts["numbers"]
        self.constants: dict[str, float] = self._facts["constants"]
        self.texts: dict[str, list[tuple[int, str]]] = self._facts["texts"]
        self._known = frozenset(self.names)

    def __len__(self) -> int:
        return int(self._facts["count"])

    def __contains__(self, name: str) -> bool:
        return name in self._known or (name in HEADER_STAMP and self._facts["has_header"])

    @property
    def type_name(self) -> str:
        return str(self._facts["type"])

    @cached_property
    def decodable_name(self) -> str:
        """Return the type with which the payloads are decoded."""
        if self._schema is None:
            return self.type_name
        name, described = self._schema
        return decodable_name(Schema(0, described.encode(), "ros2msg", name))

    @cached_property
    def _mapped(self) -> tuple[Any, mmap.mmap]:
        assert self._open is not None
        return self._open()

    @property
    def arrow(self) -> Any:
        """Return its columns as stored in the file, a pyarrow.Table."""
        return self._mapped[0]

    def _column(self, name: str, first: int = 0, last: int | None = None) -> npt.NDArray[Any]:
        column = self.arrow[name].slice(first, None if last is None else last - first)
        if column.num_chunks == 1:  # to_numpy of Arrow would load pandas
            return np.from_dlpack(column.chunk(0))
        # By numpy, which returns the memory after use; Arrow's pool keeps it.
        copied: npt.NDArray[Any] = np.concatenate([np.from_dlpack(one) for one in column.chunks])
        self.release()
        return copied

    @property
    def log_ns(self) -> Stamps:
        """Return the stamps of reception at the writer, (N,)."""
        return self._column(RECEIVED) if len(self) else np.zeros(0, np.int64)

    @property
    def publish_ns(self) -> Stamps:
        """Return the stamps of the source, (N,)."""
        return self._column(STAMP) if len(self) else np.zeros(0, np.int64)

    @property
    def header_ns(self) -> Stamps:
        """Return the stamps in the messages' headers, (N,), for a type that has them."""
        delay = self._facts.get("header_delay_ns")
        if not len(self) or delay == 0:
            return self.publish_ns
        found: Stamps = self.publish_ns + (self._column(HEADER) if delay is None else delay)
        return found

    @property
    def payloads(self) -> list[bytes]:
        """Return the messages of a topic whose payloads are stored."""
        if not len(self) or PAYLOAD not in self.arrow.column_names:
            return []
        found: list[bytes] = self.arrow[PAYLOAD].to_pylist()
        return found

    def payload(self, index: int) -> bytes:
        """Return one message of a topic whose payloads are stored."""
        return bytes(self.arrow[PAYLOAD][index].as_py())

    def values(self, name: str, first: int = 0, last: int | None = None) -> Floats:
        """Return one number of the messages `first` to `last` - 1, (N,), NaN if missing.

        The array is read-only.
        """
        if name in HEADER_STAMP and name in self:
            seconds, rest = np.divmod(self.header_ns[first:last], 1_000_000_000)
            return (seconds if name == HEADER_STAMP[0] else rest).astype(self.dtype)
        if name not in self._known or name in self.constants:
            value = np.array(self.constants.get(name, np.nan), self.dtype)
            return np.broadcast_to(value, len(self))[first:last]
        found = self._column(name, first, last)
        if self.dtype == found.dtype:
            return found
        with np.errstate(over="ignore", invalid="ignore"):
            made = found.astype(self.dtype)
        self.release()
        return made

    def release(self) -> None:
        """Release the pages that were read, which otherwise count as this process's memory."""
        if len(self):
            self._mapped[1].madvise(mmap.MADV_DONTNEED)

    def take(self, names: Collection[str]) -> Floats:
        """Return (N, len(names)), NaN for a number that the topic does not have."""
        out = np.empty((len(self), len(names)), self.dtype)
        for k, name in enumerate(names):
            out[:, k] = self.values(name)
        self.release()
        return out
