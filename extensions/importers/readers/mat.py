"""MATLAB files up to version 7.2: every matrix of numbers, and those in structures by their path.

Files of version 7.3 are HDF5 and read as such.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

import numpy as np

from extensions.importers.readers.tables import WIDEST, Column, HeldColumns, foreign_reader

DEEPEST = 8
"""Largest number of structures within one another that are read."""
DEEPEST_FILE = 100
"""Largest number of matrices within one another: SciPy's compiled reader ends the process where
there are some thousands.
"""
HEAD, MATRIX, PACKED = 128, 14, 15


class MatTable(HeldColumns):
    """A column for a vector, NAME[0], NAME[1], … for a matrix; a row vector is a column, too."""

    def __init__(self, path: Path, _: Collection[str] = ()) -> None:
        """Read the file. Raises LogFormatError."""
        super().__init__(path)
        for name, values in _matrices(loaded(path, struct_as_record=False), ""):
            if 1 in values.shape:
                self._columns[name] = values.reshape(-1)
            elif values.shape[1] < WIDEST:
                self._columns |= {f"{name}[{k}]": one for k, one in enumerate(values.T)}


def loaded(path: Path, *, struct_as_record: bool = True) -> dict[str, object]:
    """Return what a file has, by name, as `scipy.io.loadmat`. Raises LogFormatError."""
    from scipy.io import loadmat

    with foreign_reader(path, "MATLAB file"):
        _check_depth(path.read_bytes())
        return dict(loadmat(path, struct_as_record=struct_as_record))


def _check_depth(data: bytes, at: int = HEAD, order: str = "") -> None:
    """Raise ValueError where a file has matrices within one another too often."""
    order = order or ("<" if data[HEAD - 2 : HEAD] == b"IM" else ">")
    ends: list[int] = []
    while at + 8 <= len(data):
        while ends and at >= ends[-1]:
            ends.pop()
        kind, size = struct.unpack_from(f"{order}II", data, at)
        at += 8
        if kind == MATRIX:
            ends.append(at + size)
            if len(ends) > DEEPEST_FILE:
                raise ValueError("it is nested too deep")
        elif kind == PACKED:
            _check_depth(zlib.decompress(data[at : at + size]), 0, order)
            at += size
        elif kind >> 16 == 0:  # else its number is in the head
            at += size + -size % 8


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
