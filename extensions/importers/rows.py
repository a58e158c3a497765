"""Rows of large tables, changed in place: a second copy may be more than an import may take."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt

from quadrotor.errors import LogFormatError
from quadrotor.records import Array, Stamps

BLOCK = 1 << 16
"""Rows that are moved at once."""


def complete(
    stamps: Array, table: Array, names: Mapping[str, Iterable[str]], where: str
) -> tuple[npt.NDArray[np.bool_], list[str]]:
    """Return which rows have all their numbers, (N,), and a note about others.

    Args:
        names: of the table's columns, in their order.

    Raises LogFormatError for columns without any number.
    """
    found = np.isfinite(stamps) & np.isfinite(table).all(axis=1)
    if not (lost := int((~found).sum())):
        return found, []
    columns = zip((one for some in names.values() for one in some), table.T, strict=True)
    if empty := [name for name, column in columns if np.isnan(column).all()]:
        raise LogFormatError(f"{where}: there is no number in {', '.join(empty)}")
    return found, [f"{where}: {lost} of {len(stamps)} rows without numbers left out"]


def keep(table: Array, rows: npt.NDArray[np.int64]) -> None:
    """Move these rows, which rise, to the beginning of a table."""
    if len(rows) == len(table):
        return
    for start in range(0, len(rows), BLOCK):
        some = rows[start : start + BLOCK]
        table[start : start + len(some)] = table[some]


def nanoseconds(seconds: Array, base_ns: int) -> Stamps:
    """Return times in s since a base as stamps, (N,)."""
    rounded = seconds * 1e9
    found: Stamps = np.round(rounded, out=rounded).astype(np.int64)
    found += base_ns
    return found


def turn(vectors: Array, matrix: Array) -> None:
    """Multiply each of (N, 3) vectors by a matrix (3, 3)."""
    for start in range(0, len(vectors), BLOCK):
        some = vectors[start : start + BLOCK]
        some[:] = some @ matrix.T
