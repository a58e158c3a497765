"""Tables of numbers by column of HDF5 and NumPy files, and the protocol of all formats."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Protocol

import numpy as np

from quadrotor.errors import LogFormatError
from quadrotor.records import Array

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
    units: dict[str, str]
    """Units of columns as the file writes them, where it does."""
    notes: list[str]
    """What a user should know about the file, in sentences."""
    flights: list[str]
    """Tables of the IMU, one for each flight, where the format tells flights apart; else empty."""

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
        self.notes: list[str] = []
        self.units: dict[str, str] = {}
        self.flights: list[str] = []

    @classmethod
    def opened(cls, path: Path, _: Collection[str]) -> FileTables:
        """Return the file; all its tables can be read. Raises LogFormatError or StorageError."""
        return cls(path)

    def tables(self) -> list[str]:
        return [""]


def check_size(path: Path, rows: int, columns: int) -> None:
    """Raise LogFormatError when a table is too large to be read."""
    if rows * columns > MAX_VALUES:
        raise LogFormatError(
            f"{path.name} has {rows} rows or more; of {columns} columns at most "
            f"{MAX_VALUES // columns} are imported: cut it into flights"
        )


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
