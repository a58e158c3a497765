"""MATLAB files up to version 7.2: every matrix of numbers, and those in structures by their path.

Files of version 7.3 are HDF5 and read as such.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

import numpy as np

from extensions.importers.readers.tables import (
    BoundedTables,
    Column,
    beyond_float,
    check_size,
    foreign_reader,
)
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

DEEPEST = 8
"""Largest number of structures within one another."""


class MatTable(BoundedTables):
    """A column for a vector, NAME[0], NAME[1], … for a matrix; a row vector is a column, too."""

    def __init__(self, path: Path, wanted: Collection[str] = ()) -> None:
        """Read the file. Raises LogFormatError."""
        from scipy.io import loadmat

        super().__init__(path, wanted)
        self._columns: dict[str, Column] = {}
        with foreign_reader(path, "MATLAB file"):
            found = loadmat(path, struct_as_record=False, squeeze_me=False)
        for name, values in _matrices(found, ""):
            if 1 in values.shape:
                self._columns[name] = values.reshape(-1)
            else:
                self._columns |= {f"{name}[{k}]": one for k, one in enumerate(values.T)}

    def columns(self, table: str) -> list[str]:
        return list(self._columns)

    def read(self, table: str, names: list[str]) -> Array:
        found = [self._columns[name] for name in names]
        check_size(self.path, len(found[0]), len(found))
        if len({len(one) for one in found}) > 1:
            listed = ", ".join(f"{name} {len(self._columns[name])}" for name in names)
            raise LogFormatError(f"{self.path.name}: columns of several lengths: {listed}")
        return np.stack(found, axis=1, dtype=np.float64)

    def remainders(self, table: str, name: str) -> Array | None:
        return beyond_float(self._columns[name])


def _matrices(
    found: Mapping[str, object], path: str, depth: int = 0
) -> Iterator[tuple[str, Column]]:
    """Yield each matrix of numbers with its path."""
    for name, value in found.items():
        if name.startswith("__") or not isinstance(value, np.ndarray):
            continue
        if value.dtype.kind in "biuf" and value.ndim == 2 and value.size > 1:
            yield path + name, value
        elif value.dtype == object and value.size == 1 and depth < DEEPEST:
            inner = getattr(value.flat[0], "__dict__", {})
            fields = {one: inner[one] for one in inner.get("_fieldnames", ())}
            yield from _matrices(fields, f"{path}{name}.", depth + 1)
