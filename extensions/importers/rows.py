"""Rows of large tables, changed in place: a second copy may be more than an import may take. The
largest tables are in a temporary file, of which memory has one block at a time.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager

import numpy as np
import numpy.typing as npt

from quadrotor.errors import LogFormatError, os_errors
from quadrotor.records import Array, Stamps

Places = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]
BLOCK = 1 << 16
"""Rows that are moved at once."""
NUMBER = 8
"""Bytes of a number."""


class Spilled:
    """A table in a temporary file, which has no name and is therefore gone with the process.

    Args:
        columns: how many it has.
        most: largest number of its rows.

    Raises StorageError.
    """

    def __init__(self, columns: int, most: int) -> None:
        with self._errors():
            self._file = tempfile.TemporaryFile()  # noqa: SIM115 - as long as its table
            self._file.truncate(NUMBER * columns * most)
            self._map = mmap.mmap(self._file.fileno(), 0)
        self.columns: Array = np.frombuffer(self._map, np.float64).reshape(columns, most)

    @staticmethod
    def _errors() -> AbstractContextManager[None]:
        place = tempfile.gettempdir()
        return os_errors(lambda why: f"cannot write in {place}: {why}; TMPDIR can name another")

    def close(self) -> None:
        """Add no more rows; the table stays."""
        self._file.close()

    def make_room(self, begin: int, count: int) -> None:
        """Take the disk's room for rows that will be written. Raises StorageError if it is full,
        of which the kernel would otherwise tell by a signal.
        """
        width, most = self.columns.shape
        count = min(count, most - begin)
        with self._errors():
            for k in range(width if count > 0 else 0):
                place = NUMBER * (k * most + begin)
                os.posix_fallocate(self._file.fileno(), place, NUMBER * count)


def release(*tables: Array) -> None:
    """Free the memory of a table that can be read from its file again; other tables stay as they
    are.
    """
    for one in tables:
        owner: object = one
        while isinstance(owner, np.ndarray):
            owner = owner.base
        if isinstance(owner, memoryview) and isinstance(owner.obj, mmap.mmap):
            owner.obj.madvise(mmap.MADV_DONTNEED)


def blocks(table: Array) -> Iterator[slice]:
    """Yield the places of blocks of a table's rows, and free each block's memory afterwards."""
    for start in range(0, len(table), BLOCK):
        yield slice(start, start + BLOCK)
        release(table)


def steps_where(values: Array, is_meant: Callable[[Array], Mask]) -> Places:
    """Return the rows k after which the steps to the rows k + 1 are meant."""
    found = [np.zeros(0, np.int64)]
    for some in blocks(values):
        steps = np.diff(values[some.start : some.stop + 1])
        places: Places = np.flatnonzero(is_meant(steps))
        places += some.start
        found.append(places)
    return np.concatenate(found)


def largest_step(values: Array) -> int:
    """Return the row after which the largest step is."""
    steps = np.diff(values)
    release(values)
    return int(np.argmax(steps))


def usual_step(values: Array) -> float:
    """Return the median of the steps ahead; 0 where there are none."""
    steps = np.diff(values)
    release(values)
    if len(steps) and not steps.min() > 0.0:
        steps = steps[steps > 0.0]
    return float(np.median(steps, overwrite_input=True)) if len(steps) else 0.0


def complete(
    stamps: Array, table: Array, names: Mapping[str, Iterable[str]], where: str
) -> tuple[Mask, list[str]]:
    """Return which rows have all their numbers, (N,), and a note about others.

    Args:
        names: of the table's columns, in their order.

    Raises LogFormatError for columns without any number.
    """
    found = np.isfinite(stamps)
    for some in blocks(table):
        found[some] &= np.isfinite(table[some]).all(axis=1)
    if not (lost := int((~found).sum())):
        return found, []
    columns = zip((one for some in names.values() for one in some), table.T, strict=True)
    if empty := [name for name, column in columns if np.isnan(column).all()]:
        raise LogFormatError(f"{where}: there is no number in {', '.join(empty)}")
    return found, [f"{where}: {lost} of {len(stamps)} rows without numbers left out"]


def keep(table: Array, rows: npt.NDArray[np.integer]) -> None:
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
    for some in blocks(vectors):
        vectors[some] = vectors[some] @ matrix.T
