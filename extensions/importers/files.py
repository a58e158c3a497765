"""The files of one import: the times and columns that a mapping names."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from extensions.importers.mapping import Columns, Mapping, Rows, column_names
from extensions.importers.physics import measurable
from extensions.importers.readers.formats import source_of
from extensions.importers.readers.tables import Source
from extensions.importers.stamps import RATES, RATES_OF_IMU, judged_seconds
from extensions.importers.units import TIME_UNITS, unit_of
from quadrotor.errors import LogFormatError, StorageError
from quadrotor.records import Array

FEWEST = 50
"""Least number of rows of IMU or truth for an import."""


class Files:
    """The files of one import, each opened once."""

    def __init__(self, path: Path, mapping: Mapping, *, torn: bool) -> None:
        self._path, self._wanted, self._torn = path, mapping.tables(), torn
        self._opened: dict[Path, Source] = {}
        self._stack = ExitStack()
        self.notes: list[str] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def source(self, rows: Rows) -> Source:
        path = self._path.parent / rows.file if rows.file else self._path
        if path not in self._opened:
            if rows.file and not path.exists():
                raise StorageError(f"{path}, which the mapping names, is not a file")
            source = self._stack.enter_context(source_of(path, self._wanted))
            self._opened[path] = source
            self.notes += source.notes
        return self._opened[path]

    def read(
        self, rows: Rows, section: str, columns: dict[str, tuple[Columns, int]]
    ) -> list[Array]:
        """Return the times (N,), s, then each of `columns`, given by names and count."""
        source = self.source(rows)
        where = f"{source.path.name}, [{section}]"
        if rows.table not in source.tables():
            tables = ", ".join(sorted(filter(None, source.tables()))[:20]) or "none"
            raise LogFormatError(f"{where}: there is no table {rows.table!r}; there are {tables}")
        known = source.columns(rows.table)
        if rows.time is not None:
            columns = {"time": (rows.time, 1), **columns}
        names = {
            word: column_names(asked, known, count, f"{where} {word}")
            for word, (asked, count) in columns.items()
        }
        table = source.read(rows.table, [one for found in names.values() for one in found])
        self._check_whole(source)
        edges = np.cumsum([len(found) for found in names.values()])[:-1]
        parts = dict(zip(names, np.split(table, edges, axis=1), strict=True))
        certain = False
        if rows.time is None:
            seconds = np.arange(len(table)) / (rows.rate or 1.0)
        else:
            certain = self._check_unit(source, names["time"][0], rows.time_unit, where)
            seconds = parts.pop("time")[:, 0]
        known_rows = np.isfinite(seconds) & np.isfinite(table).all(axis=1)
        if lost := int((~known_rows).sum()):
            self.notes.append(f"{where}: {lost} of {len(seconds)} rows without numbers left out")
        possible, notes = measurable(parts, rows, where)
        known_rows &= possible
        self.notes += notes
        unit = "s" if rows.time is None else rows.time_unit
        seconds = self._rising(seconds, known_rows, unit, section, where, certain=certain)
        kept = self._kept
        return [seconds * rows.time_scale, *(one[known_rows][kept] for one in parts.values())]

    def _check_unit(self, source: Source, name: str, stated: str, where: str) -> bool:
        """Return whether the file tells the unit of its time. Raises LogFormatError where it is
        another one than the mapping's.
        """
        written = source.units.get(name, "")
        if (told := unit_of(written)) and told != stated and told in TIME_UNITS:
            raise LogFormatError(
                f"{where}: the header has {name!r} in {written}, the mapping in {stated}: write "
                f'time_unit = "{told}", or correct the header'
            )
        return told == stated

    def _rising(
        self,
        stamps: Array,
        known: npt.NDArray[np.bool_],
        unit: str,
        section: str,
        where: str,
        *,
        certain: bool,
    ) -> Array:
        """Return rising times in s without duplicates. Raises LogFormatError."""
        fewest = 1 if section == "battery" else FEWEST
        rows = np.flatnonzero(known) + 1
        if len(rows) < fewest:
            raise LogFormatError(f"{where}: {len(rows)} rows; at least {fewest} are needed")
        seconds = stamps[known]
        if len(rows) > 1:
            rates = RATES_OF_IMU if section == "imu" else RATES
            seconds, notes = judged_seconds(seconds, unit, rows, rates, where, certain=certain)
            self.notes += notes
        self._kept = np.concatenate([[True], np.diff(seconds) > 0.0])
        if same := int((~self._kept).sum()):
            self.notes.append(f"{where}: {same} rows with the stamp of the row before left out")
        found: Array = seconds[self._kept]
        if len(found) < fewest:
            raise LogFormatError(f"{where}: {len(found)} different stamps in {len(seconds)} rows")
        return found

    def _check_whole(self, source: Source) -> None:
        if not source.torn:
            return
        if not self._torn:
            raise LogFormatError(
                f"{source.path.name} is incomplete: {source.torn}; --torn imports the part before"
            )
        note = f"{source.path.name} is incomplete: {source.torn}; imported up to there"
        if note not in self.notes:
            self.notes.append(note)
