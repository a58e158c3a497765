"""Text tables in which every cell is a plain number, read by Arrow's compiled parser."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from extensions.importers.readers.parquet import DECIMALS, decimals_of, numbers_of
from extensions.importers.readers.tables import MAX_VALUES, beyond_float, check_size
from quadrotor.records import Array

if TYPE_CHECKING:
    import pyarrow

PIECE = 1 << 20
"""Bytes that are parsed at once."""


class PlainColumns(NamedTuple):
    """Columns of a table without quoted line breaks, by their number.

    Arrow reads the same numbers as Python does. Where it cannot, as for words, dates, remarks and
    rows of other widths, there is no answer, and `TextTable` reads cell by cell.
    """

    path: Path
    delimiter: str
    skipped: int  # lines before the first row
    width: int  # of each row

    def numbers(self, wanted: Sequence[int]) -> Array | None:
        """Return columns, (N, len(wanted)), or None. Raises LogFormatError for too many rows."""
        import pyarrow as pa

        # The first column shows remarks and repeated headers.
        kinds = {column: pa.float64() for column in (0, *wanted)}
        # Memory that is never written is never taken.
        most = min(self.path.stat().st_size // (2 * self.width) + 1, MAX_VALUES // len(wanted))
        found, count = np.empty((most, len(wanted))), 0
        try:
            for batch in self._batches(kinds):
                check_size(self.path, count + len(batch), len(wanted))
                rows = found[count : count + len(batch)]
                for k, column in enumerate(wanted):
                    rows[:, k] = numbers_of(pa.chunked_array([batch.column(str(column))]))
                count += len(batch)
        except pa.ArrowException:
            return None
        return found[:count] if count else None

    def first(self) -> list[float] | None:
        """Return the numbers of the first row, or None."""
        import pyarrow as pa

        try:
            batch = next(self._batches(dict.fromkeys(range(self.width), pa.float64())), None)
        except pa.ArrowException:
            return None
        return [one[0].as_py() for one in batch.columns] if batch else None

    def remainders(self, column: int) -> Array | None:
        """Return by how much more integers, or numbers of up to 9 decimals, are than their float64,
        (N,), or None.
        """
        import pyarrow as pa

        for kind in (pa.int64(), pa.decimal128(38, DECIMALS)):
            try:
                parts = [one.column(0) for one in self._batches({column: kind})]
            except pa.ArrowException:
                continue
            if kind == pa.int64():
                return beyond_float(numbers_of(pa.chunked_array(parts, kind)))
            decimals = decimals_of(pa.chunked_array(parts, kind))
            return None if decimals is None else decimals[1]
        return None

    def _batches(self, kinds: dict[int, pyarrow.DataType]) -> Iterator[pyarrow.RecordBatch]:
        import pyarrow as pa
        from pyarrow import csv

        names = [str(k) for k in range(self.width)]
        # Arrow's own pool keeps what it does not need any more.
        pa.set_memory_pool(pa.system_memory_pool())
        with self.path.open("rb") as file:  # a name that is no UTF-8 is not opened by Arrow
            yield from csv.open_csv(
                file,
                csv.ReadOptions(
                    use_threads=False, block_size=PIECE, skip_rows=self.skipped, column_names=names
                ),
                csv.ParseOptions(delimiter=self.delimiter),
                csv.ConvertOptions(
                    check_utf8=False,
                    column_types={str(k): kind for k, kind in kinds.items()},
                    include_columns=[str(k) for k in kinds],
                    null_values=[],
                ),
            )
        pa.default_memory_pool().release_unused()
