"""Parquet files: columns of numbers or times by their names, those of structures by their path."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from extensions.importers.readers.tables import (
    Column,
    FileTables,
    beyond_float,
    check_size,
    foreign_reader,
    seconds_of,
)
from quadrotor.records import Array

if TYPE_CHECKING:
    import pyarrow


DECIMALS = 9


class ParquetTable(FileTables):
    """One table; times as integers of ns, rows without a number as NaN."""

    def __init__(self, path: Path, _: Collection[str] = ()) -> None:
        """Open the file. Raises LogFormatError."""
        from pyarrow import parquet

        super().__init__(path)
        with foreign_reader(path, "Parquet file"):
            # A name that is no UTF-8 is not opened by Arrow.
            self._file = parquet.ParquetFile(path.open("rb"))
            found = list(_leaves(self._file.schema_arrow))
        self._names = [name for name, _ in found]
        self.units = dict.fromkeys((name for name, is_time in found if is_time), "ns")

    def columns(self, table: str) -> list[str]:
        return self._names

    def read(self, table: str, names: list[str]) -> Array:
        check_size(self.path, self._file.metadata.num_rows, len(names))
        return np.stack([self._column(name) for name in names], axis=1, dtype=np.float64)

    def remainders(self, table: str, name: str) -> Array | None:
        column = self._arrow(name)
        if decimals := decimals_of(column):
            return decimals[1]
        return beyond_float(self._column(name))

    def _column(self, name: str) -> Column:
        """Return a column as the file has it. Raises LogFormatError."""
        import pyarrow as pa

        column = self._arrow(name)
        if decimals := decimals_of(column):
            return decimals[0]
        with foreign_reader(self.path, "Parquet file"):
            if pa.types.is_timestamp(column.type):
                column = column.cast(pa.timestamp("ns", column.type.tz)).cast(pa.int64())
            elif not pa.types.is_integer(column.type):
                column = column.cast(pa.float64())
            return numbers_of(column)

    def _arrow(self, name: str) -> pyarrow.ChunkedArray:
        """Return a column as Arrow has it. Raises LogFormatError."""
        import pyarrow as pa

        with foreign_reader(self.path, "Parquet file"):
            table = self._file.read([name])
            while any(pa.types.is_struct(one.type) for one in table.schema):
                table = table.flatten()
            column = table[name]
            if pa.types.is_dictionary(column.type):
                column = pa.chunked_array([one.dictionary_decode() for one in column.chunks])
            return column


def numbers_of(column: pyarrow.ChunkedArray) -> Column:
    """Return numbers with NaN where one is missing; Arrow's `to_numpy` would load pandas."""
    kind, parts = column.type.to_pandas_dtype(), []
    for chunk in filter(len, column.chunks):
        valid, data = chunk.buffers()
        rows = slice(chunk.offset, chunk.offset + len(chunk))
        values = np.frombuffer(data, kind)[rows]
        if chunk.null_count:
            bits = np.unpackbits(np.frombuffer(valid, np.uint8), bitorder="little")[rows]
            values = np.where(bits.astype(bool), values, np.nan)
        parts.append(values)
    return np.concatenate([np.zeros(0, kind), *parts])


def decimals_of(column: pyarrow.ChunkedArray) -> tuple[Array, Array] | None:
    """Return decimals as float64, and by how much they are more, (N,) each; None for other columns
    and for decimals of more digits than 9 behind the point or 19 in all.
    """
    import pyarrow as pa

    if not pa.types.is_decimal(column.type) or column.null_count:
        return None
    try:
        column = column.cast(pa.decimal128(38, DECIMALS))
    except pa.ArrowInvalid:
        return None
    parts = [np.zeros(0, np.int64)]
    for one in column.chunks:
        words = np.frombuffer(one.buffers()[1], np.int64)
        parts.append(words[2 * one.offset : 2 * (one.offset + len(one))])
    low, high = np.concatenate(parts).reshape(-1, 2).T
    if (high != low >> 63).any():
        return None
    whole, part = np.divmod(low, 10**DECIMALS)
    return seconds_of(whole.astype(np.float64), part.astype(np.float64))


def _leaves(
    fields: pyarrow.Schema | pyarrow.StructType, path: str = ""
) -> Iterator[tuple[str, bool]]:
    """Yield the name of each column of numbers or times, and whether it is one of times."""
    from pyarrow import types

    for field in fields:
        name, kind = path + field.name, field.type
        if types.is_struct(kind):
            yield from _leaves(kind, f"{name}.")
            continue
        kind = kind.value_type if types.is_dictionary(kind) else kind
        if types.is_timestamp(kind):
            yield name, True
        elif types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind):
            yield name, False
