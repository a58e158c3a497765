"""Tables of numbers by column: CSV and similar, HDF5, NumPy; and the protocol of all formats."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path
from typing import Protocol

import numpy as np

from quadrotor.errors import LogFormatError
from quadrotor.records import Array

HEAD_LINES = 2000
"""Number of lines of a text file in which its first row of numbers is searched."""
LONGEST_LINE = 1 << 20
"""Longest line in characters; a file with a longer one is not a table."""
MAX_VALUES = 16_000_000
"""Largest number of values read from a table, 128 MB: half an hour of an IMU at 1000 Hz."""


class Source(Protocol):
    """An opened file: tables by name, each with columns of one length."""

    path: Path
    epoch_ns: int | None
    """Time at which its stamps were 0, ns; None: unknown."""
    torn: str
    """Description of where it is cut off; empty if it is complete."""
    events: list[tuple[float, int, str]]
    """Time on the clock of its tables (s), level and text."""

    def tables(self) -> list[str]: ...

    def columns(self, table: str) -> list[str]: ...

    def read(self, table: str, names: list[str]) -> Array:
        """Return (N, len(names)), NaN where a number is missing. Raises LogFormatError."""
        ...


class FileTables:
    """A file that contains tables, and where it was cut off."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.epoch_ns: int | None = None
        self.torn = ""
        self.events: list[tuple[float, int, str]] = []

    @classmethod
    def opened(cls, path: Path, _: Collection[str]) -> FileTables:
        """Return the file; all its tables can be read. Raises LogFormatError or StorageError."""
        return cls(path)

    def tables(self) -> list[str]:
        return [""]


class TextTable(FileTables):
    """CSV, also with ; or spaces; columns by their header, else by their number from 0."""

    def __init__(self, path: Path) -> None:
        """Open the file. Raises LogFormatError."""
        super().__init__(path)
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            before: list[str] = []
            for number, line in enumerate(iter(lambda: file.readline(LONGEST_LINE), "")):
                if number > HEAD_LINES or len(line) == LONGEST_LINE:
                    raise _no_numbers(path)
                self._delimiter = next((one for one in ",;\t" if one in line), None)
                row = self._split(line)
                if len(row) > 1 and _number(row[0]) and sum(map(_number, row)) > len(row) / 2:
                    break
                before = row or before
            else:
                raise _no_numbers(path)
        self._skip, self._width = number, len(row)
        names = [re.sub(r"\s+[\[(][^\])]*[\])]$", "", one) for one in before]
        # A comment sign may precede the names as a separate word.
        names = names[1:] if len(names) == len(row) + 1 and not names[0] else names
        found = names if len(names) == len(row) else [str(k) for k in range(len(row))]
        self._names = found
        with path.open("rb") as file:
            file.seek(-min(4096, path.stat().st_size), 2)
            *_, last = file.read().decode(errors="replace").rstrip("\n").splitlines()
        self._rows = None
        if len(values := self._split(last)) < self._width:
            self.torn = f"its last line has {len(values)} of {self._width} values"
            with path.open("rb") as file:
                self._rows = sum(1 for _ in file) - number - 1

    def columns(self, table: str) -> list[str]:
        return self._names

    def read(self, table: str, names: list[str]) -> Array:
        wanted = [self._names.index(one) for one in names]
        most = MAX_VALUES // len(wanted) + 1
        try:
            found: Array = np.loadtxt(
                self.path,
                delimiter=self._delimiter,
                skiprows=self._skip,
                usecols=wanted,
                max_rows=most if self._rows is None else min(most, self._rows),
                ndmin=2,
                comments=None,
                converters=_value,
                encoding="utf-8-sig",
            )
        except (ValueError, IndexError) as error:
            raise LogFormatError(
                f"{self.path.name} is incomplete: {error}; cut it off after its last complete line"
            ) from None
        check_size(self.path, len(found), len(wanted))
        return found

    def _split(self, line: str) -> list[str]:
        return [one.strip(' "#\r\n') for one in line.split(self._delimiter)] if line.strip() else []


def check_size(path: Path, rows: int, columns: int) -> None:
    """Raise LogFormatError when a table is too large to be read."""
    if rows * columns > MAX_VALUES:
        raise LogFormatError(
            f"{path.name} has {rows} rows or more; of {columns} columns at most "
            f"{MAX_VALUES // columns} are imported: cut it into flights"
        )


def _number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _value(text: str) -> float:
    return float(text.strip(' "') or "nan")


def _no_numbers(path: Path) -> LogFormatError:
    return LogFormatError(f"{path.name} has no rows of numbers in its first {HEAD_LINES} lines")


class Hdf5Table(FileTables):
    """HDF5 file: every dataset is a column; one with K columns becomes NAME[0], NAME[1], …"""

    def __init__(self, path: Path) -> None:
        """Open the file. Raises LogFormatError."""
        import h5py

        super().__init__(path)
        self._widths: dict[str, int] = {}

        def note(name: str, found: object) -> None:
            if (
                isinstance(found, h5py.Dataset)
                and found.dtype.kind in "fiu"
                and found.ndim in (1, 2)
            ):
                self._widths[name] = found.shape[1] if found.ndim == 2 else 0

        try:
            with h5py.File(path) as file:
                file.visititems(note)
        except (OSError, RuntimeError, KeyError) as error:
            raise LogFormatError(
                f"{path.name} is not a complete HDF5 file: {error!s:.120}"
            ) from None

    def columns(self, table: str) -> list[str]:
        return [
            one
            for name, width in self._widths.items()
            for one in ([f"{name}[{k}]" for k in range(width)] if width else [name])
        ]

    def read(self, table: str, names: list[str]) -> Array:
        import h5py

        found = []
        try:
            with h5py.File(self.path) as file:
                for name in names:
                    stem, _, item = name.partition("[")
                    check_size(self.path, len(file[stem]), len(names))
                    found.append(file[stem][:, int(item[:-1])] if item else file[stem][:])
        except (OSError, RuntimeError) as error:
            raise LogFormatError(f"{self.path.name} is damaged: {error!s:.120}") from None
        lengths = {name: len(one) for name, one in zip(names, found, strict=True)}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise LogFormatError(f"{self.path.name}: columns of several lengths: {listed}")
        return np.stack(found, axis=1, dtype=np.float64)


class NumpyTable(FileTables):
    """Array (N, K) of a .npy file; columns by their number from 0, or by their names."""

    def __init__(self, path: Path) -> None:
        """Open the file. Raises LogFormatError."""
        super().__init__(path)
        try:
            found = np.load(path, mmap_mode="r", allow_pickle=False)
        except (ValueError, OSError, EOFError, RecursionError, MemoryError) as error:
            why = str(error) or "its head is nested too deep"
            raise LogFormatError(f"{path.name} is not a complete NumPy file: {why:.120}") from None
        if found.dtype.names:
            self._columns = {name: found[name] for name in found.dtype.names}
        elif found.ndim == 2:
            self._columns = {str(k): column for k, column in enumerate(found.T)}
        else:
            raise LogFormatError(f"{path.name} has the shape {found.shape}; rows are needed")

    def columns(self, table: str) -> list[str]:
        return list(self._columns)

    def read(self, table: str, names: list[str]) -> Array:
        columns = [self._columns[name] for name in names]
        check_size(self.path, len(columns[0]), len(columns))
        return np.stack(columns, axis=1, dtype=np.float64)
