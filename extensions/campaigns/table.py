"""The rows of files as one table, and what its columns are."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from extensions.campaigns.factors import Value
from quadrotor.errors import StorageError, os_errors

if TYPE_CHECKING:
    import pyarrow as pa

Facts = dict[str, Any]
"""A summary of a campaign, as JSON."""
FIXED_COLUMNS = ("index", "seed")
MACHINE = ("wall_", "processor_", "worker", "host")
"""Prefixes of the columns that depend on the computer."""


def joined(
    parts: Sequence[Path], factors: Sequence[str], where: Path, *, figures_only: bool = False
) -> pa.Table:
    """Return the rows of files, each flight once, in the order of their index.

    Args:
        figures_only: whether what depends on the computer is left out, and texts are dictionaries:
            a million rows then take a tenth of the memory.

    Raises StorageError if there are none, or if they cannot be read.
    """
    import pyarrow as pa

    with os_errors(lambda why: f"the rows of {where} cannot be read ({why})"):
        tables = [_read(part, figures_only) for part in parts]
    if not tables:
        raise StorageError(f"{where} has no rows yet")
    judged = sorted({name for one in tables for name in judged_metrics(one)})
    whole = tables[0]
    if len(tables) > 1:
        whole = pa.concat_tables(tables, promote_options="permissive")
    indices = numbers(whole, "index")
    if (np.diff(indices) <= 0).any():
        whole = whole.take(np.unique(indices, return_index=True)[1])
    known = [*FIXED_COLUMNS, *factors, "verdict", "reason"]
    machine = [name for name in whole.column_names if name.startswith(MACHINE)]
    metrics = sorted(set(whole.column_names) - {*known, *machine})
    whole = whole.select([*known, *metrics, *machine])
    if len(tables) > 1:
        whole = whole.combine_chunks()
    return whole.replace_schema_metadata({"judged": json.dumps(judged)})


def _read(part: Path, figures_only: bool) -> pa.Table:
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not figures_only:
        return pq.read_table(part)
    one = FileColumns(part)
    columns = [one[name] for name in one.column_names]
    return pa.table(columns, one.column_names, metadata=one.schema.metadata)


class FileColumns:
    """The figures of one file, of which a column is in memory only while somebody has it.

    It has the attributes of a pyarrow.Table that figures need. What depends on the computer is left
    out, and texts are dictionaries.
    """

    def __init__(self, part: Path) -> None:
        import pyarrow.parquet as pq

        texts = ["verdict", "reason"]
        self._file = pq.ParquetFile(part, read_dictionary=texts, pre_buffer=False)
        self.schema = self._file.schema_arrow
        self.num_rows: int = self._file.metadata.num_rows
        self.column_names = [n for n in self.schema.names if not n.startswith(MACHINE)]

    def __getitem__(self, name: str) -> pa.ChunkedArray:
        """Return a column, read at each call."""
        import pyarrow as pa

        pa.default_memory_pool().release_unused()  # of the column before
        return self._file.read([name], use_threads=False).column(0)


def figures(parts: Sequence[Path], factors: Sequence[str], where: Path) -> pa.Table | FileColumns:
    """Return the rows in their order, each flight once, without the columns that depend on the
    computer.

    A finished campaign is one file in this order, of which no more than the columns in use are in
    memory. Raises StorageError if there are none, or if they cannot be read.
    """
    if len(parts) == 1:
        with os_errors(lambda why: f"the rows of {where} cannot be read ({why})"):
            columns = FileColumns(parts[0])
            if (np.diff(numbers(columns, "index")) > 0).all():
                return columns
    return joined(parts, factors, where, figures_only=True)


def judged_metrics(table: pa.Table) -> list[str]:
    """Return the metrics that have limits: the smaller the better."""
    found: list[str] = json.loads((table.schema.metadata or {}).get(b"judged", b"[]"))
    return found


def metric_columns(table: pa.Table, factors: Sequence[str]) -> list[str]:
    """Return the names of the metrics."""
    others = {*FIXED_COLUMNS, *factors, "verdict", "reason"}
    return [n for n in table.column_names if n not in others and not n.startswith(MACHINE)]


def numbers(table: pa.Table, name: str) -> npt.NDArray[Any]:
    """Return a column of numbers, NaN where a flight has none."""
    return as_numbers(table[name])


def as_numbers(column: pa.ChunkedArray | pa.Array) -> npt.NDArray[Any]:
    """Return an Arrow column as numbers; NaN for missing values.

    Arrow's own `to_numpy`, and Python scalars in its functions, import pandas where it is
    installed, which takes a second and 50 MB.
    """
    import pyarrow as pa

    column = _one(column)
    if not column.null_count:
        return np.from_dlpack(column)
    data = np.frombuffer(column.buffers()[1], column.type.to_pandas_dtype())
    values = data[column.offset : column.offset + len(column)].astype(np.float64)
    values[np.from_dlpack(column.is_null().cast(pa.uint8())) == 1] = np.nan
    return values


def _one(column: pa.ChunkedArray | pa.Array) -> pa.Array:
    import pyarrow as pa

    if isinstance(column, pa.ChunkedArray):
        column = column.combine_chunks()
    if isinstance(column, pa.ChunkedArray):  # an empty one, or dictionaries of several chunks
        column = pa.concat_arrays(column.chunks) if column.num_chunks else pa.array([], column.type)
    return column


def encoded(column: pa.ChunkedArray) -> tuple[npt.NDArray[np.integer], list[Any]]:
    """Return for each row the number of its level, and the levels."""
    import pyarrow as pa

    one = _one(column)
    if not pa.types.is_dictionary(one.type):
        one = one.dictionary_encode()
    return as_numbers(one.indices), one.dictionary.to_pylist()


def is_verdict(table: pa.Table, verdict: str) -> npt.NDArray[np.bool_]:
    """Return for each row whether it has this verdict."""
    places, levels = encoded(table["verdict"])
    found: npt.NDArray[np.bool_] = np.array([level == verdict for level in levels], bool)[places]
    return found


def array(values: Sequence[Value]) -> pa.Array:
    """Return the values of a factor as a column; as text, if they are of several types."""
    import pyarrow as pa

    kinds = {type(one) for one in values}
    return pa.array(values if len(kinds) == 1 else [str(one) for one in values])
