"""Tables of numbers by column of HDF5 and NumPy files, and the protocol of all formats."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from flight_log.limits import bounded_reader
from quadrotor.errors import LogFormatError, QuadlabError
from quadrotor.records import Array

Column = npt.NDArray[np.generic]  # (N,), numbers as a file has them
MAX_VALUES = 16_000_000
"""Largest number of values read from a table, 128 MB: half an hour of an IMU at 1000 Hz."""
WIDEST = 10_000
"""More columns than a matrix of a flight has."""


class Source(Protocol):
    """An opened file: tables by name, each with columns of one length."""

    path: Path
    epoch_ns: int | None
    """Time at which its stamps were 0, ns; None: unknown."""
    torn: str
    """Description of where it is cut off; empty if it is complete."""
    events: list[tuple[float, int, str]]
    """Time on the clock of its tables (s), level and text."""
    units: dict[str, str]
    """Units of columns as the file writes them, where it does."""
    notes: list[str]
    """Sentences about the file that a user should read."""
    flights: list[str]
    """Tables of the IMU, one for each flight, where the format tells flights apart; else empty."""
    unreadable: dict[str, str]
    """Tables that the file has but cannot be read, and why."""

    def tables(self) -> list[str]: ...

    def columns(self, table: str) -> list[str]: ...

    def read(self, table: str, names: list[str]) -> Array:
        """Return (N, len(names)), NaN where a number is missing; the caller may change it. What is
        wrong with the rows may be known, and noted, only now. Raises LogFormatError.
        """
        ...

    def remainders(self, table: str, name: str) -> Array | None:
        """Return by how much more each number of a column is than its float64, (N,), as an integer
        beyond 2^53 can be; None where the file has no more digits. Raises LogFormatError.
        """
        ...


@contextmanager
def foreign_reader(path: Path, what: str, hint: Callable[[], str] = str) -> Iterator[None]:
    """Raise LogFormatError for whatever a library raises about a damaged file, as no library lists
    all its exceptions; the cause is kept, and `hint` returns what to try. What this program and
    the bound on memory raise stays.
    """
    try:
        with bounded_reader(path.name):
            yield
    except QuadlabError:
        raise
    except Exception as error:
        why = str(error).replace(f"{path.parent}/", "") or type(error).__name__
        raise LogFormatError(f"{path.name} is not a complete {what}: {why:.120}{hint()}") from error


class FileTables:
    """A file that contains tables, and where it was cut off."""

    def __init__(self, path: Path, _: Collection[str] = ()) -> None:
        self.path = path
        self.epoch_ns: int | None = None
        self.torn = ""
        self.events: list[tuple[float, int, str]] = []
        self.notes: list[str] = []
        self.units: dict[str, str] = {}
        self.flights: list[str] = []
        self.unreadable: dict[str, str] = {}

    def note(self, text: str) -> None:
        """Add a note, once however often a table is read."""
        if text not in self.notes:
            self.notes.append(text)

    def tables(self) -> list[str]:
        return [""]

    def remainders(self, table: str, name: str) -> Array | None:
        return None


def beyond_float(values: Column) -> Array | None:
    """Return by how much integers are more than their float64, (N,); None for other numbers."""
    if values.dtype.kind not in "iu":
        return None
    rounded = values.astype(np.float64)
    inside = np.abs(rounded) < 2.0**63  # others are no times
    whole = np.where(inside, rounded, 0.0).astype(np.int64)
    found: Array = np.where(inside, values.astype(np.int64) - whole, 0).astype(np.float64)
    return found


def seconds_of(seconds: Array, nanoseconds: Array) -> tuple[Array, Array]:
    """Return times in s as float64, and by how much more they are, (N,) each."""
    rounded = seconds + 1e-9 * nanoseconds
    whole = np.floor(rounded)
    return rounded, (seconds - whole) + (1e-9 * nanoseconds - (rounded - whole))


def narrow(values: Array) -> Array:
    """Return the same values, held once where all are alike, as those of covariances."""
    alike = len(values) > 0 and bool((values == values[0]).all())
    return np.broadcast_to(values[0].copy(), values.shape) if alike else values


def check_size(path: Path, rows: int, columns: int) -> None:
    """Raise LogFormatError when a table is too large to be read."""
    if rows * columns > MAX_VALUES:
        raise LogFormatError(
            f"{path.name} has {rows} rows or more; of {columns} columns at most "
            f"{MAX_VALUES // columns} are imported: cut it into flights"
        )


class HeldColumns(FileTables):
    """One table, of whose columns all or those asked for are in memory."""

    def __init__(self, path: Path, _: Collection[str] = ()) -> None:
        """Open the file. Raises LogFormatError."""
        super().__init__(path)
        self._columns: dict[str, Column] = {}

    def columns(self, table: str) -> list[str]:
        return list(self._columns)

    def read(self, table: str, names: list[str]) -> Array:
        found = self._held(names)
        lengths = {name: len(one) for name, one in zip(names, found, strict=True)}
        check_size(self.path, max(lengths.values()), len(names))
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise LogFormatError(f"{self.path.name}: columns of several lengths: {listed}")
        return np.stack(found, axis=1, dtype=np.float64)

    def remainders(self, table: str, name: str) -> Array | None:
        return beyond_float(self._held([name])[0])

    def _held(self, names: list[str]) -> list[Column]:
        """Return columns as the file has them. Raises LogFormatError."""
        return [self._columns[name] for name in names]


class Hdf5Table(HeldColumns):
    """HDF5 file: every dataset is a column; one with K columns becomes NAME[0], NAME[1], …"""

    def __init__(self, path: Path, _: Collection[str] = ()) -> None:
        """Open the file. Raises LogFormatError."""
        import h5py

        super().__init__(path)
        self._widths: dict[str, int] = {}
        self._turned: set[str] = set()

        def note(name: str, found: object) -> None:
            if (
                isinstance(found, h5py.Dataset)
                and found.dtype.kind in "fiu"
                and found.ndim in (1, 2)
            ):
                rows, width = found.shape if found.ndim == 2 else (len(found), 0)
                if width > rows and "MATLAB_class" in found.attrs:  # which writes them turned
                    self._turned.add(name)
                    width = rows if rows > 1 else 0
                if width < WIDEST:
                    self._widths[name] = width

        with foreign_reader(path, "HDF5 file"), h5py.File(path) as file:
            file.visititems(note)

    def columns(self, table: str) -> list[str]:
        return [
            one
            for name, width in self._widths.items()
            for one in ([f"{name}[{k}]" for k in range(width)] if width else [name])
        ]

    def _held(self, names: list[str]) -> list[Column]:
        import h5py

        found = []
        with foreign_reader(self.path, "HDF5 file"), h5py.File(self.path) as file:
            for name in names:
                stem, _, item = name.partition("[")
                rows = file[stem]
                if stem in self._turned:
                    check_size(self.path, rows.shape[1], len(names))
                    found.append(rows[int(item[:-1]) if item else 0])
                else:
                    check_size(self.path, len(rows), len(names))
                    found.append(rows[:, int(item[:-1])] if item else rows[:])
        return found


class NumpyTable(HeldColumns):
    """Array (N, K) of a .npy file; columns by their number from 0, or by their names."""

    def __init__(self, path: Path, _: Collection[str] = ()) -> None:
        """Open the file. Raises LogFormatError."""
        super().__init__(path)
        with foreign_reader(path, "NumPy file"):
            try:
                found = np.load(path, mmap_mode="r", allow_pickle=False)
            except MemoryError as error:  # of Python's parser: the file itself is mapped
                raise ValueError("its head is nested too deep") from error
        if found.dtype.names:
            self._columns = {name: found[name] for name in found.dtype.names}
        elif found.ndim == 2 and found.shape[1] < WIDEST:
            self._columns = {str(k): column for k, column in enumerate(found.T)}
        for name, column in self._columns.items():
            if column.dtype.kind in "Mm":
                self._columns[name] = column.astype(f"{column.dtype.kind}8[ns]").view(np.int64)
                self.units[name] = "ns"
        self._columns = {
            name: one for name, one in self._columns.items() if one.dtype.kind in "biuf"
        }
        if not self._columns:
            raise LogFormatError(
                f"{path.name} has the shape {found.shape} of {found.dtype!s:.40}; rows of numbers "
                "are needed"
            )
